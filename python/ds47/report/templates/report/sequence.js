// One conversation as a sequence diagram: controller on the left, drive on the right, time downwards.

const POLLS_DRAWN = 4;

/** The steps of a conversation: [{right, title, note, frame, wrong, lost}]; `right` goes to the drive. */
function steps(capture, row) {
  const list = [];
  const state = capture.state(row);
  const get = (name) => capture.get(row, name);
  const write = capture.status(row, "write_status");
  const read = capture.status(row, "read_status");
  const add = (right, words, frame, note = "", wrong = false) => list.push({ right, title: say(words), frame, note, wrong, lost: frame === null });
  const verdict = (status) => (status === null ? "" : status[0] === "00000000" ? say("accepted") : `${status[0]} ${either(status, 1)}`);
  const bad = (status) => status !== null && status[0] !== "00000000";

  if (capture.isPkw(row) || capture.isS7(row)) {
    const [asked, told] = capture.isS7(row) ? ["s7_request", "s7_response"] : ["pkw_request", "pkw_response"];
    const silent = capture.operation(row) === "usend";
    add(true, asked, get("write_request"));
    if (!silent) add(false, told, get("read_response"), outcome(state), ["error", "mismatch", "partial", "refused"].includes(state));
    return list;
  }
  if (get("write_request") !== null || state === "orphan") add(true, "write_request", get("write_request"));
  if (get("write_request") !== null) add(false, "write_response", get("write_response"), verdict(write), bad(write));
  const polls = get("polls") || [];
  for (const [request, response] of polls.slice(0, POLLS_DRAWN)) {
    add(true, "read_request", request);
    add(false, "read_response", response, say("poll"));
  }
  if (polls.length > POLLS_DRAWN) list.push({ gap: say("polls_more", { n: polls.length - POLLS_DRAWN }) });
  const over = bad(write) && get("read_request") === null && get("read_response") === null;
  if (!over) {
    add(true, "read_request", get("read_request"));
    add(false, "read_response", get("read_response"), get("read_response") === null ? "" : bad(read) ? verdict(read) : outcome(state), bad(read) || ["error", "partial", "mismatch"].includes(state));
  }
  for (const [request, response] of (get("rereads") || []).slice(0, 2)) {
    add(true, "read_request", request, say("reread"));
    add(false, "read_response", response, say("reread"));
  }
  return list;
}

function outcome(state) {
  return ["ok", "partial", "error", "mismatch"].includes(state) ? stateName(state) : "";
}

/** The drawing. */
function sequence(capture, row) {
  const list = steps(capture, row);
  const [left, right, width, pitch] = [90, 430, 520, 38];
  const height = 64 + list.length * pitch;
  const drawing = svg("svg", { class: "sequence", viewBox: `0 0 ${width} ${height}`, role: "img" });
  const spoken = list.map((step) => step.gap || `${step.title}${step.note ? `: ${step.note}` : ""}`).join("; ");
  drawing.setAttribute("aria-label", say("sequence_label", { id: capture.get(row, "id"), steps: spoken }));
  const line = (x) => svg("line", { class: "life", x1: x, x2: x, y1: 34, y2: height - 10 });
  const text = (x, y, words, kind, anchor = "middle") => svg("text", { x, y, class: kind, "text-anchor": anchor }, cut(words, 58));
  drawing.append(
    text(left, 20, capture.controller(row), "end"),
    text(right, 20, cut(capture.target(row), 30), "end"), line(left), line(right));
  list.forEach((step, number) => {
    const y = 62 + number * pitch;
    if (step.gap) return drawing.append(text((left + right) / 2, y, `⋮ ${step.gap}`, "soft"));
    const [from, to] = step.right ? [left, right] : [right, left];
    const tip = step.right ? -9 : 9;
    const missing = step.lost ? ` – ${say("not_captured")}` : step.note ? ` – ${step.note}` : "";
    const group = svg("g", { class: `${step.wrong ? "wrong " : ""}${step.lost ? "lost" : ""}`.trim() || null },
      text((left + right) / 2, y - 6, step.title + missing, "label"),
      svg("line", { class: "arrow", x1: from, x2: to + tip / 2, y1: y, y2: y }),
      svg("path", { class: "head", d: `M${to} ${y} l${tip} -4.5 v9 z` }));
    if (step.frame !== null) {
      group.append(text(step.right ? left - 8 : right + 8, y + 4, String(step.frame), "soft", step.right ? "end" : "start"));
    }
    return drawing.append(group);
  });
  const took = capture.get(row, "duration");
  if (took !== null) drawing.append(text(width - 8, 46, duration(took), "soft", "end"));
  return drawing;
}

function cut(text, most) {
  return text.length > most ? `${text.slice(0, most - 1)}…` : text;
}
