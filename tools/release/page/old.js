// Says that the browser is too old; written for the oldest ones, so that they can read it.
(function () {
  var missing = [];
  function wants(name, there) { if (!there) missing.push(name); }
  wants("WebAssembly", typeof WebAssembly === "object");
  wants("Worker", typeof Worker === "function");
  wants("DecompressionStream", typeof DecompressionStream === "function");
  // A function of WebAssembly with try and catch: without them Python does not start.
  wants("WebAssembly exceptions", typeof WebAssembly === "object" && WebAssembly.validate(new Uint8Array([
    0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 10, 8, 1, 6, 0, 6, 64, 25, 11, 11
  ])));
  window.ds47Missing = missing;
  if (!missing.length) return;
  document.documentElement.className += " old";
  document.addEventListener("DOMContentLoaded", function () {
    document.getElementById("missing").appendChild(document.createTextNode(missing.join(", ")));
  });
})();
