// Unpacks the page's module, data and scripts, which live.py has compressed into it, and starts the script `live`.
const DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[]^_abcdefghijklmnopqrstuvwxyz|~";

// Four bytes are five digits to the base of 85, which takes less room than base64.
function bytesOf(text) {
  const values = new Map([...DIGITS].map((digit, value) => [digit.charCodeAt(0), value]));
  const digits = text.padEnd(Math.ceil(text.length / 5) * 5, "~");
  const bytes = new Uint8Array((digits.length / 5) * 4);
  const words = new DataView(bytes.buffer);
  for (let group = 0; group < digits.length / 5; ++group) {
    let word = 0;
    for (let i = 0; i < 5; ++i) {
      word = word * 85 + values.get(digits.charCodeAt(5 * group + i));
    }
    words.setUint32(4 * group, word);
  }
  return bytes.subarray(0, Math.floor((text.length * 4) / 5));
}

async function unpacked(id) {
  if (!("DecompressionStream" in window)) {
    throw new Error("This page needs a browser of 2023 or later: this one cannot unpack it.");
  }
  const bytes = bytesOf(document.getElementById(id).textContent);
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
