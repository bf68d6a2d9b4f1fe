// The table of parameters: what each held last, how often it was read and changed, and with what outcome.

const ELEMENT = ["device", "object", "pnu", "subindex", "en", "zh", "unit", "reads", "accepted", "negative", "sent", "refused", "last", "written", "last_in", "error", "error_in"];

const KIND_OF = { negative: "error", sent: "unanswered", refused: "refused" };

/** `1 read, 2 change`; 0 where there is neither. */
function splitText([reads, changes]) {
  const pairs = [[reads, operationName("read")], [changes, operationName("change")]].filter(([n]) => n);
  return pairs.length ? told(pairs) : "0";
}

function parameterTable(place, capture) {
  const stations = new Map(capture.devices);
  const rows = capture.elements.rows.map((row, number) => ({ number, ...Object.fromEntries(ELEMENT.map((name, at) => [name, row[at]])) }));
  const drive = (row) => (stations.get(row.device) || row.device) + (row.object ? ` ${row.object}` : "");
  const job = (id) => (id === null ? [] : [" ", el("a", { href: `#job-${capture.number}-${id}` }, `#${id}`), " ", el("span", { class: "dim time" }, capture.began(id))]);
  const count = (name, words) => ({ key: name, words, number: true, most: true, value: (row) => row[name], text: (row) => grouped(row[name]) });
  // Pairs of reads and changes.
  const split = (name, words) => ({
    key: name, words, number: true, most: true, value: (row) => row[name][0] + row[name][1],
    cell: (row) => el("span", { class: row[name][0] + row[name][1] ? `state ${KIND_OF[name]}` : null }, splitText(row[name])),
  });
  const name = (row) => either([row.en, row.zh]);
  const changes = changeCounts(capture);
  const trail = (row) => {
    const n = changes.get([row.device, row.object, row.pnu, row.subindex].join("/"));
    const wanted = { place: `${row.device}/${row.object}`, p: row.pnu, search: capture.element(row.pnu, row.subindex) };
    return n ? el("div", { class: "noprint" }, el("a", { class: "trail", href: trailLink(capture.number, wanted) }, say("trail_link", { n: grouped(n) }))) : null;
  };
  const choices = [...new Map(rows.map((row) => [`${row.device}/${row.object}`, drive(row)]))];
  return new Table(place, {
    id: `p${capture.number}`, name: "col_parameter", rows, key: (row) => row.number,
    columns: [
      { key: "drive", words: "col_device", value: (row) => drive(row), text: (row) => drive(row) },
      { key: "parameter", words: "col_parameter", class: "mono", value: (row) => row.pnu * 65536 + row.subindex, cell: (row) => el("div", {}, capture.element(row.pnu, row.subindex), trail(row)) },
      { key: "name", words: "col_name", value: name, text: name },
      count("reads", "col_reads"), count("accepted", "col_accepted"),
      split("negative", "col_negative"), split("sent", "col_sent"), split("refused", "col_refused"),
      {
        key: "last", words: "col_last", class: "value", value: (row) => (row.last === null || Number.isNaN(Number(row.last)) ? row.last : Number(row.last)),
        cell: (row) => (row.last === null ? "" : el("span", {}, row.written ? ":= " : "", row.last, row.unit ? ` ${row.unit}` : "", job(row.last_in))),
      },
      { key: "reason", words: "col_reason", value: (row) => (row.error ? row.error[0] : ""), cell: (row) => (row.error ? el("span", {}, either(row.error), job(row.error_in)) : "") },
    ],
    filters: [{ words: "drive", choices: () => [["", say("all")], ...choices], fits: (row, value) => `${row.device}/${row.object}` === value }],
    haystack: (row) => [drive(row), row.device, capture.element(row.pnu, row.subindex), row.en, row.zh, row.last, ...(row.error || [])].join(" "),
    detail: null,
  });
}
