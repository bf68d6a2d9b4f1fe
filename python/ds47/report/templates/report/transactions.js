// The table of transactions, and what one of them shows when it is opened.

function transactionTable(place, capture) {
  const get = (row, name) => capture.get(row, name);
  const table = new Table(place, {
    id: capture.number, name: "col_what", rows: capture.rows, key: (row) => get(row, "id"),
    columns: [
      { key: "id", words: "col_id", value: (row) => get(row, "id"), cell: (row, open) => expander(capture, row, open) },
      timeColumn(capture, (row) => get(row, "start")),
      { key: "operation", words: "col_operation", value: (row) => capture.operation(row), text: (row) => operationName(capture.operation(row)) },
      { key: "device", words: "col_device", value: (row) => capture.drive(row), text: (row) => (capture.manyControllers ? `${capture.controller(row)} → ${capture.drive(row)}` : capture.drive(row)) },
      { key: "axis", words: "col_axis", number: true, value: (row) => get(row, "axis"), text: (row) => (get(row, "axis") === null ? "" : String(get(row, "axis"))) },
      { key: "what", words: "col_what", class: "what", value: (row) => summary(capture, row), cell: (row) => what(capture, row) },
      { key: "state", words: "col_state", value: (row) => get(row, "state"), cell: (row) => stateCell(capture.state(row)) },
      { key: "duration", words: "col_duration", number: true, value: (row) => get(row, "duration"), text: (row) => (get(row, "duration") === null ? "" : duration(get(row, "duration"))) },
      { key: "frames", words: "col_frames", number: true, value: (row) => capture.frames(row)[0], text: (row) => framesText(capture.frames(row)) },
      { key: "findings", words: "col_findings", class: "mono", value: (row) => capture.rulesOf(row).map(([rule]) => rule).join(" "), cell: (row) => ruleLinks(capture, row) },
    ],
    filters: [
      {
        words: "outcome", choices: () => [["", say("all")], ["problems", say("problems")], ...stateGroups(capture), ...present(capture, "state", capture.states)],
        fits: (row, value) => (value === "problems" ? capture.state(row) !== "ok" || get(row, "findings").length > 0 : [capture.state(row), capture.kinds[capture.state(row)]].includes(value)),
      },
      { words: "operation", choices: () => [["", say("all")], ...present(capture, "operation", capture.operations)], fits: (row, value) => capture.operation(row) === value },
      { words: "drive", choices: () => [["", say("all")], ...places(capture)], fits: (row, value) => String(get(row, "object")) === value },
    ],
    haystack: (row) => haystack(capture, row),
    detail: (row) => detail(capture, row),
  });
  return table;
}

/** Time of day, and below it the seconds since the first frame; these alone where no time of day is known. */
function timeColumn(capture, start) {
  const { clock } = capture;
  const cell = (row) => el("div", {}, clock.at(start(row)), el("div", { class: clock.known ? "dim" : null }, `${clock.since(start(row))} s`));
  return { key: "start", words: "col_start", number: true, class: "time", value: start, cell };
}

/** The name of a state with what it means. */
function stateCell(state) {
  return el("span", { class: `state ${state}`, title: say(`about_${state}`) }, stateName(state));
}

/** States under one name, as the verdict counts them. */
function stateGroups(capture) {
  const there = new Set(capture.rows.map((row) => capture.kinds[capture.state(row)]));
  return [["bad", stateName("failed")], ["open", stateName("open")]].filter(([kind]) => there.has(kind));
}

function present(capture, field, names) {
  const found = new Set(capture.rows.map((row) => capture.get(row, field)));
  return names.flatMap((name, place) => (found.has(place) ? [[name, say(`${field}_${name}`)]] : []));
}

function places(capture) {
  const found = new Map();
  for (const row of capture.rows) {
    found.set(String(capture.get(row, "object")), capture.target(row));
  }
  return [...found].sort(([, a], [, b]) => compare(a, b, 1));
}

function expander(capture, row, open) {
  const id = capture.get(row, "id");
  return el("button", { type: "button", class: "expander", "aria-expanded": String(open), "aria-label": say("details", { id }) }, `#${id}`);
}

function framesText(frames) {
  if (!frames.length) return "";
  return frames.length === 1 ? String(frames[0]) : `${frames[0]}…${frames[frames.length - 1]}`;
}

function ruleLinks(capture, row) {
  const links = capture.rulesOf(row).flatMap(([rule], number) => [number ? " " : "", el("a", { href: `#finding-${capture.number}-${rule}` }, rule)]);
  return links.length ? [el("span", {}, links)] : [];
}

/** What a transaction asked and got, as nodes: the first parameters, the failed ones marked. */
function what(capture, row) {
  const items = capture.parameters(row);
  const nodes = items.slice(0, 3).map((item) => el("div", {}, ...parameterNodes(capture, row, item)));
  if (items.length > 3) nodes.push(el("div", { class: "label" }, say("more_parameters", { n: items.length - 3 })));
  return nodes;
}

function parameterNodes(capture, row, item) {
  const nodes = [item.text];
  const name = either(item.names);
  if (item.values.length) nodes.push(` ${["read", "get", "vendor", "unknown"].includes(capture.operation(row)) ? "=" : ":="} ${capture.valuesText(item, 4)}`);
  if (item.error) nodes.push(" ", el("span", { class: "failed" }, capture.errorText(item.error)));
  if (name) nodes.push(" ", el("span", { class: "label" }, name));
  return nodes;
}

function summary(capture, row) {
  return capture.parameters(row).map((item) => `${item.text} ${item.values.join(" ")}`).join(" ");
}

function haystack(capture, row) {
  const statuses = ["write_status", "read_status"].map((name) => capture.status(row, name)).filter((status) => status && status[0] !== "00000000").flat();
  const items = capture.parameters(row).flatMap((item) => [item.text, ...item.names, capture.valuesText(item, 64), item.error ? capture.errorText(item.error) : ""]);
  return [`#${capture.get(row, "id")}`, capture.operation(row), capture.state(row), operationName(capture.operation(row)), stateName(capture.state(row)), capture.controller(row),
    ...capture.devices[capture.get(row, "device")], capture.frames(row).join(" "), ...capture.rulesOf(row).flat(), ...statuses, ...items].join(" ");
}

/** An opened transaction: facts and diagram on one side, its frames on the other. */
function detail(capture, row) {
  const id = capture.get(row, "id");
  const [ar, api, slot, subslot, index] = capture.channels[capture.get(row, "channel")];
  const channel = index === "s7" ? "channel_s7" : index === null ? "channel_pkw" : subslot === null ? "channel_dp" : "channel_text";
  const place = say(channel, { connection: ar, slot, subslot, api, index: index > 255 ? `0x${index.toString(16).toUpperCase()}` : index });
  const filter = displayFilter(capture.frames(row));
  const facts = [
    ["controller", capture.controller(row)],
    ["drive", `${capture.devices[capture.get(row, "device")].filter(Boolean).reverse().join(", ")}`],
    ["channel", place],
    ["started", capture.clock.whole(capture.get(row, "start"))],
    ["col_duration", capture.get(row, "duration") === null ? "–" : duration(capture.get(row, "duration"))],
  ];
  const messages = (capture.messages[id] || []).map(([rule, frame, en, zh, others]) => el("li", {},
    el("a", { class: "rule", href: `#finding-${capture.number}-${rule}` }, rule), ` ${either([en, zh])} `, el("span", { class: "dim" }, `(${say("frame", { n: frame })}`, ...others.flatMap((other) => [", ", frameLink(capture, other)]), ")")));
  return el("div", { class: "inside", role: "region", "aria-label": say("details", { id }) },
    el("div", {},
      messages.length ? el("ul", { class: "found" }, messages) : null,
      el("p", { class: "plc" }, either(capture.plc[capture.get(row, "plc")])),
      el("dl", { class: "facts" }, facts.flatMap(([words, text]) => [el("dt", { title: terms(words) }, say(words)), el("dd", {}, text)]),
        describedFacts(capture.parameters(row)),
        el("dt", {}, say("filter")), el("dd", {}, el("code", { class: "copyable" }, filter), " ", el("button", { type: "button", class: "copy", "data-copy": true }, say("copy")))),
      el("h3", {}, say("conversation")), sequence(capture, row)),
    el("div", {}, el("h3", {}, say("frames_title")), frameCards(capture, row)));
}

/** Which parameters are named or measured as the drive itself described them, and where. */
function describedFacts(items) {
  const found = items.filter((item) => item.described);
  if (!found.length) return [];
  const texts = found.slice(0, 8).map((item) => `${item.text}: ${item.described.map((n) => say("frame", { n })).join(", ")}`);
  return [el("dt", {}, say("described")), el("dd", {}, texts.join("; ") + (found.length > 8 ? "; …" : ""))];
}

/** The number of a frame, as a link to the job that has it. */
function frameLink(capture, [frame, job]) {
  return job === null ? String(frame) : el("a", { href: `#job-${capture.number}-${job}` }, String(frame));
}

/** Request and response of PKW, or of S7: the bytes as they stand in the frames. */
function plainCards(capture, row, asked, told) {
  return [[asked, "write_request", "request"], [told, "read_response", "response"]].map(([words, name, bytes]) => {
    const frame = capture.get(row, name);
    const hex = capture.get(row, bytes);
    return el("div", { class: "frame-card" },
      el("h4", {}, `${say(words)} `, el("span", { class: "dim" }, frame === null ? say("not_captured") : say("frame", { n: frame }))),
      hex ? el("p", {}, el("code", { class: "copyable" }, hex.match(/.{1,4}/g).join(" "))) : null);
  });
}

function frameCards(capture, row) {
  if (capture.isPkw(row)) return plainCards(capture, row, "pkw_request", "pkw_response");
  if (capture.isS7(row)) return plainCards(capture, row, "s7_request", "s7_response");
  const parameters = capture.parameters(row);
  const status = (name) => {
    const found = capture.status(row, name);
    return found === null ? null : found[0] === "00000000" ? say("accepted") : `${found[0]}: ${either(found, 1)}`;
  };
  const reads = capture.get(row, "read_request") !== null || capture.get(row, "read_response") !== null;
  const cards = [
    ["write_request", capture.get(row, "request"), "request", null],
    ["write_response", null, null, status("write_status")],
  ];
  const polls = capture.get(row, "polls") || [];
  if (polls.length) cards.push(["poll", null, null, polls.map(([a, b]) => `${a ?? "–"} → ${b ?? "–"}`).slice(0, 20).join(", ")]);
  if (reads || capture.state(row) !== "refused") {
    cards.push(["read_request", null, null, null], ["read_response", capture.get(row, "response"), "response", status("read_status")]);
  }
  return cards.map(([words, hex, kind, note]) => {
    const frame = words === "poll" ? polls[0][0] : capture.get(row, words);
    const place = frame === null ? say("not_captured") : say("frame", { n: frame });
    return el("div", { class: "frame-card" },
      el("h4", {}, `${say(words)} `, el("span", { class: "dim" }, words === "poll" ? "" : place)),
      note ? el("p", { class: "dim" }, note) : null,
      hex ? messageTable(capture, hex, kind, parameters) : null,
      !hex && !note && frame !== null ? el("p", { class: "dim" }, say("no_message")) : null);
  });
}
