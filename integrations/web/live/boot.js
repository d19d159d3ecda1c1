// Unpacks the page's module, data and scripts, which live.py has compressed into it, and starts the script `live`.
async function unpacked(id) {
  if (!("DecompressionStream" in window)) {
    throw new Error("This page needs a browser of 2023 or later: this one cannot unpack it.");
  }
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

unpacked("live").then(
  (script) => {
    const started = document.createElement("script");
    started.type = "module";
    started.textContent = new TextDecoder().decode(script);
    document.body.append(started);
  },
  ({ message }) => {
    const problem = document.getElementById("problem");
    problem.hidden = false;
    problem.textContent = message;
  },
);
