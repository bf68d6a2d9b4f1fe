// A DS47 message byte by byte, with what each part means.
//
// Nothing is decoded here: values, names and errors are those of the analysis. Only where the parts begin and end
// is worked out, by the layout of the message; where that does not fit, the rest stays as it is.

const REQUEST_IDS = { 1: "id_read", 2: "id_change" };
const RESPONSE_IDS = { 1: "id_read_ok", 2: "id_change_ok", 0x81: "id_read_bad", 0x82: "id_change_bad", 0x80: "id_unsupported" };
const ZERO = 0x40;
const ERROR = 0x44;

/** The parts of a request or response: [{offset, bytes, text, wrong, title}]. */
class Parts {
  constructor(capture, hex, parameters) {
    const [shown, more] = hex.split("+");
    this.capture = capture;
    this.bytes = shown.match(/../g) || [];
    this.more = more ? Number(more) : 0;
    this.parameters = parameters;
    this.at = 0;
    this.list = [];
  }

  byte(offset) {
    return parseInt(this.bytes[offset], 16);
  }

  has(size) {
    return this.at + size <= this.bytes.length;
  }

  take(size, text, wrong = false, title = null) {
    const bytes = this.bytes.slice(this.at, this.at + size);
    if (bytes.length) this.list.push({ offset: this.at, bytes, text, wrong, title });
    this.at += bytes.length;
  }

  header(ids, words) {
    const known = ids[this.byte(1)];
    const name = say(known || "id_other", { hex: this.bytes[1] ? this.bytes[1].toUpperCase() : "" });
    this.take(1, say("reference", { n: this.byte(0) }), false, terms("reference"));
    this.take(1, say(words, { text: name }), words === "response_id" && this.byte(1) >= 0x80);
    this.take(1, say("axis", { n: this.byte(2) }), false, terms("axis"));
    this.take(1, say("count", { n: this.byte(3) }));
    return known;
  }

  request() {
    const known = this.header(REQUEST_IDS, "request_id");
    const count = this.byte(3);
    if (!known) return this.rest();
    for (let number = 0; number < count && this.has(6); number += 1) {
      const item = this.parameters[number]?.pnu === null ? null : this.parameters[number]; // whose it is is not known
      this.take(6, say("address", {
        text: item ? item.text : this.capture.spelling(this.byte(this.at + 2) * 256 + this.byte(this.at + 3)),
        attribute: item && item.attribute ? item.attribute : `0x${hex2(this.byte(this.at))}`, n: this.byte(this.at + 1),
      }), false, terms("address"));
    }
    if (known === "id_change") for (let number = 0; number < count && this.block(number); number += 1);
    return this.rest();
  }

  response() {
    const known = this.header(RESPONSE_IDS, "response_id");
    const count = this.byte(3);
    if (known && known !== "id_change_ok") for (let number = 0; number < count && this.block(number); number += 1);
    return this.rest();
  }

  /** One value block; false where its length is not known. */
  block(number) {
    if (!this.has(2)) return false;
    const item = this.parameters[number];
    const format = this.byte(this.at);
    const count = this.byte(this.at + 1);
    if (format === ERROR) return this.errorBlock(item, count);
    if (format === ZERO) {
      this.take(2, say("format_zero"));
      return true;
    }
    const size = item && item.format ? this.capture.sizes[item.format] : undefined;
    if (!size) return false;
    this.take(2, say("format", { text: item.format, n: count }));
    const length = size * count;
    if (!this.has(length)) return false;
    this.take(length, say("values", { address: item.text, text: this.capture.valuesText(item) }));
    if (length % 2) this.take(1, say("pad"));
    return true;
  }

  errorBlock(item, count) {
    this.take(2, say("format_error", { n: count }), true);
    const text = item && item.error ? this.capture.errorText(item.error).replace(/ \(0x\w+\)$/, "") : "";
    if (count >= 1 && this.has(2)) {
      this.take(2, say("error_number", { hex: hexNumber(this.byte(this.at) * 256 + this.byte(this.at + 1)), text }), true);
    }
    if (count >= 2 && this.has(2)) this.take(2, say("error_info", { text: this.byte(this.at) * 256 + this.byte(this.at + 1) }));
    if (count > 2) this.take((count - 2) * 2, say("rest"));
    return true;
  }

  rest() {
    this.take(this.bytes.length - this.at, say("rest"));
    return this.list;
  }
}

/** A message as a table: offset, bytes, meaning. */
function messageTable(capture, hex, kind, parameters) {
  const parts = new Parts(capture, hex, parameters);
  const rows = parts[kind]().map((part) => el("tr", { class: part.wrong ? "wrong" : null },
    el("td", { class: "number dim" }, String(part.offset)),
    el("td", { class: "hex" }, part.bytes.join(" ")), el("td", { title: part.title }, part.text)));
  if (parts.more) rows.push(el("tr", {}, el("td", { colspan: 3, class: "dim" }, say("cut", { n: grouped(parts.more) }))));
  const heads = [["offset", "number"], ["bytes", ""], ["meaning", ""]];
  return el("table", { class: "bytes" },
    el("thead", {}, el("tr", {}, heads.map(([words, name]) => el("th", { scope: "col", class: name || null }, say(words))))),
    el("tbody", {}, rows));
}
