// Times of a capture as every report says them (ds47.report.clock): time of day in the zone of the report, and seconds
// since the first frame. Both are cut to milliseconds. The zone of who reads the page plays no part.

const DAY = 86400;

class Clock {
  /** told: what html/views/times.py says of the first frame and the zone. */
  constructor(told) {
    Object.assign(this, told);
  }

  /** [time of day, date, offset] of microseconds since the first frame; empty texts where a calendar has no such day. */
  parts(us) {
    const ms = this.ms + Math.floor((this.ns + Math.round(us * 1000)) / 1e6);
    const [, ahead] = this.ahead.findLast(([from]) => from <= us) || this.ahead[0];
    const there = new Date(ms + ahead * 1000);
    if (Number.isNaN(there.getTime())) return ["", "", ""];
    const [date, time] = there.toISOString().replace("Z", "").split("T");
    const minutes = Math.floor(Math.abs(ahead) / 60);
    const two = (number) => String(number).padStart(2, "0");
    return [time, date, `${ahead < 0 ? "-" : "+"}${two(Math.floor(minutes / 60))}:${two(minutes % 60)}`];
  }

  /** Seconds that the day of the first frame had by then. */
  secondOfDay() {
    const [, ahead] = this.ahead.findLast(([from]) => from <= 0) || this.ahead[0];
    return (((this.ms / 1000 + this.ns / 1e9 + ahead) % DAY) + DAY) % DAY;
  }

  /** `12:14:03.412`, with its date and offset where these are needed; empty where no time of day is known. */
  at(us) {
    if (!this.known) return "";
    const [time, date, offset] = this.parts(us);
    return `${this.dated ? `${date} ` : ""}${time}${this.offset ? ` ${offset}` : ""}`.trim();
  }

  /** Seconds since the first frame, as in Wireshark. */
  since(us) {
    return (Math.floor(us / 1000) / 1000).toFixed(3);
  }

  /** Both. */
  both(us) {
    return [this.at(us), `${this.since(us)} s`].filter(Boolean).join(" · ");
  }

  /** A time with its date and offset. */
  whole(us) {
    if (!this.known) return `${this.since(us)} s`;
    const [time, date, offset] = this.parts(us);
    return `${date} ${time} ${offset}`;
  }
}

/** The clock of the capture of that number. */
function clockOf(number) {
  return new Clock(JSON.parse(document.querySelector(`article[data-capture="${number}"]`).dataset.clock));
}
