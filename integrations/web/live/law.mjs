// The text of a visitor's function as a law, in the worker, and its errors as sentences.
import { LawError } from "../fracgyro.mjs";

// The law of a text, with its own memory: { force, report }. Throws whatever the text throws.
export function lawOf(text, plant) {
  const isFunction = (name) => `typeof ${name} === "function" ? ${name} : undefined`;
  const found = `{ force: ${isFunction("force")}, report: ${isFunction("report")} }`;
  // All in front of the text is on its first line, so that lines keep their numbers.
  const source = `(function (plant) { "use strict"; ${text}\n; return ${found}; })\n//# sourceURL=${FILE}`;
  const law = watched(() => (0, eval)(source)(plant))();
  if (!law.force) {
    throw new LawError("there is no function force(s): it must be defined");
  }
  return Object.fromEntries(Object.entries(law).map(([name, of]) => [name, of && watched(of)]));
}
const FILE = "law.js";
let raised = null; // { error }: what a text has thrown last

function watched(call) {
  return (...given) => {
    try {
      return call(...given);
    } catch (error) {
      raised = { error };
      throw error;
    }
  };
}

// The gyroscope of a scenario, as a law gets it.
export function plantOf({ settings, scales }) {
  const of = (matrix) =>
    ["xx", "xy", "yy"].map((part) => settings[`plant.${matrix}.${part}`] / (scales[`plant.${matrix}.${part}`] ?? 1));
  return { step: settings["run.step"], damping: of("damping"), stiffness: of("stiffness") };
}

// One sentence for an error of a law, and its line, if that is known; null for any other error.
export function failureOf(error, text) {
  if (!(error instanceof LawError) && raised?.error !== error) {
    return null;
  }
  const message = String(error?.message ?? error);
  const named = message.startsWith("report") ? "report" : "force";
  const line = lineOf(error) ?? (error instanceof LawError ? lineOfFunction(named, text) : 0);
  const words = message.replace(/^the law returned/, "it returned");
  return { problem: `Your function${line ? `, line ${line}` : ""}: ${words}`, line: line || null };
}

function lineOf(error) {
  const found = new RegExp(`${FILE}:(\\d+)`).exec(error?.stack ?? "");
  return found ? Number(found[1]) : lineReported(error);
}

// Errors of syntax have their line only in the event of an error that nobody has caught.
function lineReported(error) {
  if (!(error instanceof SyntaxError) || !globalThis.reportError) {
    return undefined;
  }
  let line;
  const listen = (event) => {
    line = event.lineno || undefined;
    event.preventDefault();
  };
  addEventListener("error", listen);
  reportError(error);
  removeEventListener("error", listen);
  return line;
}

// 0: there is none.
function lineOfFunction(name, text) {
  const at = text.search(new RegExp(`\\b${name}\\s*[=(]`));
  return at < 0 ? 0 : text.slice(0, at).split("\n").length;
}
