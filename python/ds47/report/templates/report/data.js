// The data that the page carries: unpacked on demand, with names in place of positions.

/** The text of a data element, unpacked where it is packed. */
async function embedded(id) {
  const element = document.getElementById(id);
  if (element.type !== "application/gzip") return element.textContent;
  if (typeof DecompressionStream === "undefined") throw new Error(say("too_old"));
  const stream = new Blob([fromBase64(element.textContent.trim())]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const chars = atob(text);
  const bytes = new Uint8Array(chars.length);
  for (let place = 0; place < chars.length; place += 1) bytes[place] = chars.charCodeAt(place);
  return bytes;
}

/** A display filter for frames, sorted, in the form that every Wireshark takes: sets of one element, joined by `or`. */
function displayFilter(frames) {
  const runs = [];
  for (const frame of frames) {
    const last = runs[runs.length - 1];
    if (last && frame === last[1] + 1) last[1] = frame;
    else runs.push([frame, frame]);
  }
  return runs.slice(0, 60).map(([first, last]) => (first === last ? `frame.number == ${first}` : `frame.number in {${first}..${last}}`)).join(" or ");
}

/** A capture as the scripts see it. Rows stay short arrays; `field` says which place has what. */
class Capture {
  constructor(number, data) {
    Object.assign(this, data);
    this.number = number;
    this.clock = clockOf(number);
    this.field = Object.fromEntries(data.row.map((name, place) => [name, place]));
    this.manyControllers = data.controllers.length > 1;
  }

  get(row, name) {
    return row[this.field[name]];
  }

  operation(row) {
    return this.operations[this.get(row, "operation")];
  }

  state(row) {
    return this.states[this.get(row, "state")];
  }

  /** Whether it was asked in cyclic frames: such a channel has no record index. */
  isPkw(row) {
    return this.channels[this.get(row, "channel")][4] === null;
  }

  /** Whether it is a job of S7: its channel is a connection. */
  isS7(row) {
    return this.channels[this.get(row, "channel")][4] === "s7";
  }

  /** Station name where there is one, else the IP address. */
  drive(row) {
    const [ip, station] = this.devices[this.get(row, "device")];
    return station || ip;
  }

  /** The drive, and what of it a request reached, as far as that is known. */
  target(row) {
    const name = this.objects[this.get(row, "object")];
    return this.drive(row) + (name ? ` ${name}` : "");
  }

  /** When a transaction began, that of an id too: time of day where one is known, else seconds. */
  began(id) {
    this.starts ??= new Map(this.rows.map((row) => [this.get(row, "id"), this.get(row, "start")]));
    const us = this.starts.get(id);
    return us === undefined ? "" : this.clock.at(us) || `${this.clock.since(us)} s`;
  }

  /** A number as it is printed where it is asked for elsewhere, else as one of which nothing is known: `p0010`, `61000`. */
  spelling(pnu) {
    const known = this.addresses.find((address) => address[1] === pnu);
    if (known) return known[0].match(/^\w+/)[0];
    return pnu >= BARE ? String(pnu) : `p${String(pnu).padStart(4, "0")}`;
  }

  /** One element of a parameter: `r0945[0]`. */
  element(pnu, subindex) {
    return `${this.spelling(pnu)}[${subindex}]`;
  }

  controller(row) {
    return this.controllers[this.get(row, "controller")];
  }

  status(row, name) {
    const place = this.get(row, name);
    return place === null ? null : this.statuses[place];
  }

  rulesOf(row) {
    return this.get(row, "findings").map((place) => this.rules[place]);
  }

  frames(row) {
    const single = ["write_request", "write_response", "read_request", "read_response"].map((name) => this.get(row, name));
    const pairs = [this.get(row, "polls"), this.get(row, "rereads")].flatMap((list) => (list ? list.flat() : []));
    return [...new Set([...single, ...pairs].filter((frame) => frame !== null))].sort((a, b) => a - b);
  }

  parameters(row) {
    return this.get(row, "parameters").map((item) => this.parameter(item));
  }

  parameter([place, values, count, scaled, error, meant]) {
    const [text, pnu, subindex, attribute, elements, en, zh, unit, format, described] = this.addresses[place];
    return {
      text, pnu, subindex, attribute, elements, names: [en, zh], unit, format, values, count,
      scaled: scaled || null, error: error === undefined || error === null ? null : this.errors[error], described: described || null, meant: meant || null,
    };
  }

  /** One value as text: a float shows that it is one. */
  valueText(item, number) {
    const value = item.values[number];
    if (typeof value !== "number") return value;
    return item.format && item.format.startsWith("Float") && Number.isInteger(value) && Math.abs(value) < 1e15
      ? value.toFixed(1) : String(value);
  }

  valuesText(item, most = 8) {
    if (!item.values.length) return "";
    const shown = item.values.slice(0, most).map((_, number) => this.valueText(item, number)).join(", ");
    const more = item.count > Math.min(most, item.values.length) ? ` ${say("values_more", { n: grouped(item.count) })}` : "";
    const scaled = item.scaled ? ` (${item.scaled.slice(0, most).join(", ")})` : "";
    return shown + more + scaled + (item.unit ? ` ${item.unit}` : "") + (item.meant ? ` (${either(item.meant)})` : "");
  }

  errorText(error) {
    const [number, en, zh] = error;
    return either([en, zh]) + (number === null ? "" : ` (${number})`);
  }
}

/** An error number: two digits, four where it is longer than a byte. */
function hexNumber(number) {
  return number > 0xFF ? number.toString(16).toUpperCase().padStart(4, "0") : hex2(number);
}

function hex2(number) {
  return number.toString(16).toUpperCase().padStart(2, "0");
}

const captures = new Map();

/** The capture of that number; its data is read once. */
function capture(number) {
  if (!captures.has(number)) {
    captures.set(number, embedded(`data-${number}`).then((text) => new Capture(number, JSON.parse(text))));
  }
  return captures.get(number);
}
