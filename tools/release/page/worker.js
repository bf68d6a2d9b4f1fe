// The thread in which Python runs: unpacks it, gives it files, runs a command of ds47, sends back what it wrote.
//
// What the command does is the business of ds47; what is shown, that of page.js. Nothing is fetched: fetch() is
// replaced by one that only knows the parts of the page.
//
// Messages in:  {load: {NAME: gzip in base64}}, then {id, argv, files: [{name, file}], keep: bool}
// Messages out: {ready: VERSION}, {id, read: BYTES}, {id, status, stdout, stderr, made: [{name, data}]}, {failed: TEXT}
"use strict";

const EVERY_MS = 100; // between two words about how far it is
const WORK = "/captures", MADE = "/made";
let python = null, running = null, read = 0, said = 0;

function bytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text), found = new Uint8Array(raw.length);
  for (let at = 0; at < raw.length; at += 1) found[at] = raw.charCodeAt(at);
  return found;
}

async function unpacked(text) {
  const stream = new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const script = (data) => import(URL.createObjectURL(new Blob([data], { type: "text/javascript" })));

async function load(packed) {
  // Chromium starts no module worker for a page that is a file, and Pyodide wants one: a worker that can import(), but
  // has no importScripts(), is one to it.
  self.importScripts = () => { throw new Error("nothing is loaded"); };
  const parts = {};
  for (const [name, text] of Object.entries(packed)) parts[name] = await unpacked(text);
  const { loadPyodide, version } = await script(parts["pyodide.mjs"]);
  const { default: createPyodideModule } = await script(parts["pyodide.asm.mjs"]);
  self.fetch = async (url) => {
    const name = String(url).split("/").pop();
    if (!parts[name]) throw new Error(`nothing is fetched: ${url}`);
    return new Response(parts[name], { headers: { "Content-Type": "application/wasm" } });
  };
  python = await loadPyodide({
    indexURL: "ds47://page/", createPyodideModule,
    lockFileContents: new TextDecoder().decode(parts["pyodide-lock.json"]),
    packageBaseUrl: "ds47://page/",
  });
  python.unpackArchive(parts["ds47.zip"], "zip", { extractDir: "/lib/ds47" });
  const { FS } = python;
  FS.mkdir(WORK);
  FS.mkdir(MADE);
  follow(FS.filesystems.WORKERFS);
  python.runPython(new TextDecoder().decode(parts["run.py"]));
  postMessage({ ready: version });
}

// Tells the page how much of its files was read: a command may take a minute, and says nothing while it runs.
function follow(system) {
  const plain = system.stream_ops.read;
  system.stream_ops.read = (...words) => {
    const count = plain(...words), now = performance.now();
    read += count;
    if (running !== null && now - said > EVERY_MS) {
      said = now;
      postMessage({ id: running, read });
    }
    return count;
  };
}

function empty(FS, folder) {
  for (const name of FS.readdir(folder)) {
    if (name === "." || name === "..") continue;
    const path = `${folder}/${name}`;
    if (FS.isDir(FS.stat(path).mode)) { empty(FS, path); FS.rmdir(path); } else FS.unlink(path);
  }
}

function* written(FS, folder, prefix) {
  for (const name of FS.readdir(folder).sort()) {
    if (name === "." || name === "..") continue;
    const path = `${folder}/${name}`;
    if (FS.isDir(FS.stat(path).mode)) yield* written(FS, path, `${prefix}${name}/`);
    else yield { name: prefix + name, data: FS.readFile(path) };
  }
}

function run({ id, argv, files, keep }) {
  const { FS } = python;
  running = id;
  read = 0;
  if (!keep) empty(FS, MADE);
  const blobs = files.map(({ name, file }) => ({ name, data: file }));
  FS.mount(FS.filesystems.WORKERFS, { blobs }, WORK);
  try {
    const { status, stdout, stderr } = JSON.parse(python.globals.get("run")(JSON.stringify(argv)));
    const made = [...written(FS, MADE, "")];
    postMessage({ id, status, stdout, stderr, made }, made.map((each) => each.data.buffer));
  } finally {
    running = null;
    python.runPython("import os; os.chdir('/')");
    FS.unmount(WORK);
  }
}

onmessage = async ({ data }) => {
  try {
    if (data.load) await load(data.load);
    else run(data);
  } catch (problem) {
    postMessage({ failed: String(problem && problem.message || problem), id: data.id });
  }
};
