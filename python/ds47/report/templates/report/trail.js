// The trail of each parameter: who changed it, when, by which way, from which value to which, and what came of it.

/** The changes of a capture with the rows of their transactions, and with names in place of positions. */
function changesOf(capture) {
  const { row: names, rows, objects, ways, reasons, outcomes, names: parameters } = capture.trail;
  const jobs = new Map(capture.rows.map((row) => [capture.get(row, "id"), row]));
  const stations = new Map(capture.devices);
  return rows.map((row, number) => {
    const change = Object.fromEntries(names.map((name, at) => [name, row[at]]));
    const [device, object, drive_object] = objects[change.object];
    const [en, zh, unit, spelling] = parameters[change.name];
    const drive = (stations.get(device) || device) + (object ? ` ${object}` : "");
    return {
      ...change, number, job: jobs.get(change.id), device, drive_object, drive, place: `${device}/${object}`, names: [en, zh], unit, spelling,
      way: ways[change.way], outcome: outcomes[change.outcome], reason: change.reason === null ? null : reasons[change.reason],
      address: `${spelling}[${change.subindex}]`,
    };
  });
}

const OUTCOME = { accepted: ["ok", "trail_accepted"], negative: ["error", "trail_negative"], refused: ["refused", "trail_refused"], sent: ["unanswered", "trail_sent"] };

function outcomeText({ outcome }) {
  return say(OUTCOME[outcome][1]);
}

function oldValue(change) {
  if (change.old === null) return el("span", { class: "dim", title: say("trail_not_known") }, "?");
  const words = change.old_from < 0 ? "trail_old_written" : "trail_old_read";
  return el("span", { title: say(words, { n: Math.abs(change.old_from) }) }, change.old);
}

function changeCell(change) {
  return el("span", {}, oldValue(change), " → ", change.new ?? "?", change.unit ? ` ${change.unit}` : "");
}

function outcomeCell(change) {
  const nodes = [el("span", { class: `state ${OUTCOME[change.outcome][0]}` }, outcomeText(change))];
  if (change.reason) nodes.push(el("div", {}, either(change.reason)));
  return el("div", {}, nodes);
}

/** Choices of a filter: each value once, with its text. */
function choicesOf(changes, value, text) {
  const found = new Map(changes.map((change) => [String(value(change)), text(change)]));
  return [["", say("all")], ...[...found].sort(([, a], [, b]) => compare(a, b, 1))];
}

function trailTable(place, capture) {
  const changes = changesOf(capture);
  const who = (change) => capture.controller(change.job);
  const start = (change) => capture.get(change.job, "start");
  const text = (key, words, of) => ({ key, words, value: of, text: of });
  return new Table(place, {
    id: `t${capture.number}`, name: "trail_title", rows: changes, key: (change) => change.number, detail: null, printed: 30, changes,
    columns: [
      { ...timeColumn(capture, start), key: "time" },
      { key: "frame", words: "trail_frame", number: true, value: (change) => capture.frames(change.job)[0], text: (change) => String(capture.frames(change.job)[0]) },
      { key: "id", words: "col_id", value: (change) => change.id, cell: (change) => el("a", { href: `#job-${capture.number}-${change.id}` }, `#${change.id}`) },
      text("who", "controller", who), text("drive", "col_device", (change) => change.drive), text("way", "trail_way", (change) => change.way),
      { key: "parameter", words: "col_parameter", class: "value", value: (change) => change.pnu * 65536 + change.subindex, cell: (change) => el("span", {}, change.address, " ", el("span", { class: "dim label" }, either(change.names))) },
      { key: "change", words: "trail_change", class: "value", value: (change) => change.new, cell: changeCell },
      { key: "outcome", words: "col_state", value: (change) => change.outcome, cell: outcomeCell },
    ],
    filters: [
      { words: "drive", choices: () => choicesOf(changes, (change) => change.place, (change) => change.drive), fits: (change, value) => change.place === value },
      { words: "col_parameter", choices: () => choicesOf(changes, (change) => change.pnu, (change) => `${change.spelling} ${either(change.names)}`.trim()), fits: (change, value) => String(change.pnu) === value },
      { words: "controller", choices: () => choicesOf(changes, who, who), fits: (change, value) => who(change) === value },
      { words: "outcome", choices: () => choicesOf(changes, (change) => change.outcome, outcomeText), fits: (change, value) => change.outcome === value },
    ],
    haystack: (change) => [change.address, ...change.names, change.drive, change.device, who(change), change.way, change.old, change.new, outcomeText(change), ...(change.reason || []), `#${change.id}`].join(" "),
  });
}

/** How often each element was to be changed: by device, drive object, PNU and subindex. */
function changeCounts(capture) {
  const counts = new Map();
  const { objects } = capture.trail;
  for (const [, object, , pnu, subindex] of capture.trail.rows) {
    const key = [...objects[object].slice(0, 2), pnu, subindex].join("/");
    counts.set(key, (counts.get(key) || 0) + 1);
  }
  return counts;
}

/** A link to the trail of a capture: of a drive object, by its name or its number, and of a parameter. */
function trailLink(number, wanted) {
  return `#trail-${number}?${new URLSearchParams(wanted)}`;
}

/** Shows of the trail what a link asks for. */
function narrowTrail(table, query) {
  const wanted = new URLSearchParams(query);
  const numbered = (change) => change.device === wanted.get("device") && String(change.drive_object) === wanted.get("do");
  const place = wanted.get("do") === null ? wanted.get("place") : table.changes.find(numbered)?.place;
  table.narrow([place || "", wanted.get("p") || "", "", ""], wanted.get("search") || "");
}
