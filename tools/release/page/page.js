// What the page does: takes files, makes a command line of what is chosen, lets the worker run it, shows the outcome.
// Every button is a command of ds47, which stands above its outcome; what is in that, ds47 says.
"use strict";

(() => {
  if (window.ds47Missing.length) return;
  const $ = (selector, within = document) => within.querySelector(selector);
  const $$ = (selector, within = document) => [...within.querySelectorAll(selector)];
  const words = JSON.parse($("#words").textContent);
  const say = (key) => words[key][document.documentElement.lang];
  const sections = $$(".desk > section:not(#result)");
  const MADE = "/made/";
  const TYPES = { html: "text/html", json: "application/json", csv: "text/csv", txt: "text/plain" };
  const SHOWN = 400000; // characters of text that are shown; all of it can be saved

  // Files

  const chosen = { captures: [], a: [], b: [], list: [] };
  const size = (bytes) => bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;

  function list(kind) {
    for (const drop of $$(`.drop[data-kind="${kind}"]`)) {
      const rows = chosen[kind].map(({ name, file }) => {
        const row = document.createElement("li");
        const label = Object.assign(document.createElement("span"), { className: "name", textContent: name });
        const bytes = Object.assign(document.createElement("span"), { className: "dim number", textContent: size(file.size) });
        const button = Object.assign(document.createElement("button"), { type: "button", textContent: "×", title: say("remove") });
        button.setAttribute("aria-label", `${say("remove")}: ${name}`);
        button.onclick = () => { chosen[kind] = chosen[kind].filter((each) => each.name !== name); list(kind); };
        row.append(label, bytes, button);
        return row;
      });
      drop.nextElementSibling.replaceChildren(...rows);
    }
  }

  function add(kind, found) {
    if (!found.length) return;
    const many = kind === "captures", names = new Set(found.map((each) => each.name));
    chosen[kind] = many ? [...chosen[kind].filter((each) => !names.has(each.name)), ...found] : found.slice(0, 1);
    chosen[kind].sort((one, two) => one.name < two.name ? -1 : 1);
    list(kind);
    const current = $("section.current");
    if (current.id === "report" && kind === "captures") actions.report(current);
  }

  const plain = (file) => ({ name: (file.webkitRelativePath || file.name).replace(/^\/+/, ""), file });

  async function entries(entry, prefix = "") {
    if (entry.isFile) {
      const file = await new Promise((good, bad) => entry.file(good, bad));
      return [{ name: prefix + entry.name, file }];
    }
    const reader = entry.createReader(), found = [];
    for (;;) { // a reader gives at most a hundred at a time
      const some = await new Promise((good, bad) => reader.readEntries(good, bad));
      if (!some.length) return found;
      for (const each of some) found.push(...await entries(each, `${prefix}${entry.name}/`));
    }
  }

  const isCapture = ({ name }) => /\.(pcap|pcapng|cap)(\d*)(\.gz|\.zst)?$/i.test(name);

  async function dropped(items) {
    const roots = [...items].map((each) => each.webkitGetAsEntry && each.webkitGetAsEntry()).filter(Boolean);
    const found = [];
    for (const root of roots) {
      const inside = await entries(root);
      found.push(...root.isDirectory ? inside.filter(isCapture) : inside);
    }
    return found;
  }

  for (const drop of $$(".drop")) {
    const kind = drop.dataset.kind;
    for (const input of $$("input[type=file]", drop)) {
      input.onchange = () => {
        const found = [...input.files].map(plain);
        add(kind, input.webkitdirectory ? found.filter(isCapture) : found);
        input.value = "";
      };
      const button = $(`button[data-for="${input.name}"]`, drop);
      if (button) button.onclick = (event) => { event.preventDefault(); input.click(); };
    }
    drop.ondragover = (event) => { event.preventDefault(); drop.classList.add("over"); };
    drop.ondragleave = () => drop.classList.remove("over");
    drop.ondrop = async (event) => {
      event.preventDefault();
      event.stopPropagation();
      drop.classList.remove("over");
      add(kind, await dropped(event.dataTransfer.items));
    };
  }
  $("#show-sample").onclick = async () => {
    const { textContent, dataset } = $("#sample");
    const packed = Uint8Array.from(atob(textContent), (each) => each.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const file = new File([await new Response(stream).arrayBuffer()], dataset.name);
    add("captures", [{ name: dataset.name, file }]);
  };
  // A file that misses the field is not opened instead of the page.
  window.ondragover = (event) => event.preventDefault();
  window.ondrop = async (event) => {
    event.preventDefault();
    const first = $("section.current .drop");
    if (first) add(first.dataset.kind, await dropped(event.dataTransfer.items));
  };

  // The worker

  let worker = null, ready = null, asked = 0;
  const open = new Map();

  function state(kind, key, more = "") {
    $("#state").className = `standing ${kind}`;
    $("#state-text").textContent = say(key) + more;
    $("#state-text").dataset.key = key;
  }

  function start() {
    state("", "loading");
    const url = URL.createObjectURL(new Blob([$("#worker").textContent], { type: "text/javascript" }));
    worker = new Worker(url);
    ready = new Promise((good, bad) => {
      worker.onmessage = ({ data }) => {
        if (data.ready) { state("ready", "ready"); good(); }
        else if (data.failed && !open.has(data.id)) { state("failed", "failed", ` ${data.failed}`); bad(new Error(data.failed)); }
        else heard(data);
      };
      worker.onerror = (event) => {
        event.preventDefault();
        bad(new Error(event.message));
        if (open.size) lost(event.message); else state("failed", "failed", ` ${event.message}`);
      };
    });
    ready.catch(() => {});
    const load = {};
    for (const part of $$("script[data-part]")) load[part.dataset.part] = part.textContent;
    worker.postMessage({ load });
  }

  function heard(data) {
    const job = open.get(data.id);
    if (!job) return;
    if (data.read !== undefined) { job.far(data.read); return; }
    open.delete(data.id);
    if (data.failed) { job.bad(new Error(data.failed)); lost(data.failed); } else job.good(data);
  }

  function lost(why) {
    worker.terminate();
    for (const job of open.values()) job.bad(new Error(why));
    open.clear();
    start();
  }

  async function ask(argv, files, far = () => {}, keep = false) {
    await ready;
    const id = asked += 1;
    state("", "running");
    try {
      return await new Promise((good, bad) => {
        open.set(id, { good, bad, far });
        worker.postMessage({ id, argv, files, keep });
      });
    } finally {
      if (!open.size && $("#state-text").dataset.key === "running") state("ready", "ready");
    }
  }

  // Commands

  function split(text) {
    const found = [];
    let rest = text.trim();
    while (rest) {
      const part = /^(?:[^\s"']+|"[^"]*"|'[^']*')+/.exec(rest);
      if (!part) throw new Error(say("bad-quotes"));
      found.push(part[0].replace(/"([^"]*)"|'([^']*)'/g, (_, one, two) => one ?? two));
      rest = rest.slice(part[0].length).trimStart();
    }
    return found;
  }

  const quoted = (word) => /^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
  const typed = (argv) => ["ds47", ...argv.map((each) => quoted(each.startsWith(MADE) ? each.slice(MADE.length) || "." : each))].join(" ");
  const language = () => document.documentElement.lang === "zh" ? ["--lang", "zh"] : [];
  const field = (section, name) => $(`[name="${name}"]`, section);
  const chosenIn = (section) => $$("[data-option]", section)
    .flatMap(({ dataset, value }) => value.trim() ? [dataset.option, value.trim()] : []);
  const options = (section) => [...chosenIn(section), ...split(field(section, "options").value)];

  let urls = [];
  function url(data, type) {
    const found = URL.createObjectURL(new Blob([data], { type }));
    urls.push(found);
    return found;
  }

  function show(id, text) {
    const shown = $(id);
    shown.textContent = text;
    shown.hidden = !text;
  }

  function offer({ name, data }) {
    const ending = name.split(".").pop(), type = TYPES[ending] || "application/octet-stream";
    const item = document.createElement("li"), link = document.createElement("a");
    Object.assign(link, { href: url(data, type), download: name.split("/").pop(), textContent: `${say("save")} ${name}` });
    item.append(link, ` (${size(data.byteLength)})`);
    if (ending === "html") {
      const other = document.createElement("a");
      Object.assign(other, { href: link.href, target: "_blank", textContent: say("open") });
      item.append(" · ", other);
      $("#page").src = link.href;
      $("#page").hidden = false;
    }
    return item;
  }

  let shownBy = null; // the section whose outcome stands below it

  function clear(argv) {
    shownBy = $("section.current");
    for (const each of urls) URL.revokeObjectURL(each);
    urls = [];
    $("#result").hidden = false;
    for (const id of ["#result", "#page"]) $(id).classList.remove("away");
    $("#shown-command").textContent = typed(argv);
    for (const id of ["#messages", "#text", "#outcome"]) show(id, "");
    $("#made").replaceChildren();
    $("#made").hidden = true;
    $("#page").hidden = true;
    $("#page").removeAttribute("src");
  }

  // Runs a command and shows what it wrote. `keep` as a file: what it prints, under that name.
  async function perform(argv, files, keep = null) {
    clear(argv);
    const total = files.reduce((sum, each) => sum + each.file.size, 0), begun = performance.now();
    const bar = $("#progress"), far = $("#far");
    bar.removeAttribute("value");
    bar.hidden = far.hidden = $("#stop").hidden = false;
    far.textContent = "";
    const seconds = () => ((performance.now() - begun) / 1000).toFixed(1);
    try {
      const done = await ask(argv, files, (read) => {
        const part = Math.min(read, total);
        bar.value = part / total;
        far.textContent = `${say("read")} ${size(part)} ${say("of")} ${size(total)}, ${seconds()} s`;
      });
      show("#messages", done.stderr);
      const made = [...done.made];
      if (keep && done.stdout) made.push({ name: keep, data: new TextEncoder().encode(done.stdout) });
      $("#made").replaceChildren(...made.map(offer));
      $("#made").hidden = !made.length;
      $("#made").files = made; // for whoever looks into the page
      show("#text", done.stdout.slice(0, SHOWN));
      $("#outcome").dataset.status = done.status;
      show("#outcome", `${say("status")} ${done.status}, ${seconds()} s`);
    } catch (problem) {
      show("#messages", `${problem.message}\n${say(problem.stopped ? "stopped" : "broke")}`);
    } finally {
      bar.hidden = far.hidden = $("#stop").hidden = true;
    }
  }

  $("#stop").onclick = () => {
    const stopped = Object.assign(new Error(""), { stopped: true });
    for (const job of open.values()) job.bad(stopped);
    open.clear();
    worker.terminate();
    start();
  };
  $("#copy-command").onclick = () => navigator.clipboard.writeText($("#shown-command").textContent);

  const ENDINGS = { html: "html", text: "txt", json: "json", junit: "xml", sarif: "sarif", parameters: "csv", csv: "csv", events: "csv" };
  const stem = (name) => name.split("/").pop().replace(/\.(gz|zst)$/i, "").replace(/\.[^.]*$/, "");

  function need(files) {
    if (!files.length) throw new Error(say("no-files"));
    return files;
  }

  // The folder that was dropped, as the command would take it; else the files.
  function named(files) {
    const tops = new Set(files.map((each) => each.name.split("/")[0]));
    const folder = tops.size === 1 && files.every((each) => each.name.includes("/"));
    return folder ? [...tops] : files.map((each) => each.name);
  }

  function written(section, argv, name) {
    const format = field(section, "format").value, file = `${name}.${ENDINGS[format]}`;
    const output = format === "html" ? ["-o", MADE + file] : [];
    return [[argv[0], "-f", format, ...language(), ...options(section), ...output, ...argv.slice(1)], file];
  }

  const actions = {
    report(section) {
      const files = need(chosen.captures), names = named(files);
      const [argv, file] = written(section, ["report", ...names], names.length === 1 ? stem(names[0]) : "report");
      return perform(argv, files, file);
    },
    compare(section) {
      const [one, two] = [need(chosen.a)[0], need(chosen.b)[0]];
      const same = one.name === two.name;
      const files = [{ ...one, name: same ? `A/${one.name}` : one.name }, { ...two, name: same ? `B/${two.name}` : two.name }];
      const [argv, file] = written(section, ["diff", files[0].name, files[1].name], `${stem(one.name)}-${stem(two.name)}`);
      return perform(argv, files, file);
    },
    export(section) {
      const files = need(chosen.captures);
      const examples = field(section, "examples").checked, anonymise = field(section, "anonymise").checked;
      const one = files.length === 1 && !examples;
      return perform([
        "export", ...language(), ...options(section), ...examples ? ["--examples"] : [],
        ...anonymise ? ["--anonymise", "--key", `${MADE}key.json`] : [],
        "-o", one ? `${MADE}${stem(files[0].name)}.ds47.pcapng` : MADE, ...files.map((each) => each.name),
      ], files);
    },
    async lists(section) {
      const files = need(chosen.list);
      const taken = await ask(["params", "import", ...language(), ...options(section), files[0].name], files);
      const all = await ask(["params", "list", ...language()], []);
      show("#lists .answer", [taken.stdout, taken.stderr, all.stdout].filter(Boolean).join("\n"));
    },
    command(section) {
      const argv = split(field(section, "line").value.replace(/^\s*ds47\s+/, ""));
      // What a command writes goes where the page finds it.
      const at = argv.findIndex((each) => each === "-o" || each === "--output");
      if (at >= 0 && argv[at + 1] && argv[at + 1] !== "-") argv[at + 1] = MADE + argv[at + 1].replace(/^\/+/, "");
      return perform(argv, chosen.captures);
    },
  };

  async function act(section) {
    try {
      await actions[section.id](section);
    } catch (problem) {
      clear([]);
      $("#shown-command").textContent = "";
      show("#messages", problem.message);
    }
  }

  for (const section of sections) {
    for (const button of $$(".go", section)) button.onclick = () => act(section);
  }
  $("#command form").onsubmit = (event) => { event.preventDefault(); act($("#command")); };
  for (const form of $$("#codes form")) {
    form.onsubmit = async (event) => {
      event.preventDefault();
      const text = form.elements.text.value.trim() || form.elements.text.placeholder;
      form.elements.text.value = text;
      const format = form.elements.format ? ["-f", form.elements.format.value] : [];
      const own = form.dataset.command === "encode" ? [text] : text.split(/\s+/);
      const answer = $(".answer", form);
      try {
        const done = await ask([form.dataset.command, ...language(), ...format, ...own], []);
        answer.textContent = done.stdout + done.stderr;
      } catch (problem) {
        answer.textContent = problem.message;
      }
      answer.hidden = false;
    };
  }

  // The page itself

  function turn() {
    const name = location.hash.slice(1);
    const current = sections.find((each) => each.id === name) || sections[0];
    for (const each of sections) each.classList.toggle("current", each === current);
    for (const link of $$("nav a")) {
      if (link.hash === `#${current.id}`) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
    }
  }
  window.onhashchange = () => {
    turn();
    const other = $("section.current") !== shownBy;
    for (const id of ["#result", "#page"]) $(id).classList.toggle("away", other);
  };

  function speak(lang) {
    document.documentElement.lang = lang;
    for (const button of $$("[data-lang]")) button.setAttribute("aria-pressed", String(button.dataset.lang === lang));
    for (const option of $$("[data-word]")) option.textContent = say(option.dataset.word);
    $("#state-text").textContent = say($("#state-text").dataset.key || "loading");
    for (const kind of Object.keys(chosen)) list(kind);
  }
  for (const button of $$("[data-lang]")) button.onclick = () => speak(button.dataset.lang);
  $("#theme").onclick = () => {
    const dark = getComputedStyle(document.documentElement).colorScheme.includes("dark");
    document.documentElement.classList.remove("dark", "light");
    document.documentElement.classList.add(dark ? "light" : "dark");
  };

  turn();
  speak((navigator.language || "en").startsWith("zh") ? "zh" : "en");
  start();
})();
