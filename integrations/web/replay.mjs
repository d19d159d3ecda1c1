// Answers every motion in the file "motion" (doubles: x, y and their rates) with a row in the file "answer": the force,
// and what the controller reported before it. For comparing targets bit by bit. Run in a folder with what `make web`
// builds:
//
//     node replay.mjs SCENARIO.json float|double
import { readFileSync, writeFileSync } from "node:fs";
import { load } from "./fracgyro.mjs";

const [name, number] = process.argv.slice(2);
const json = (file) => JSON.parse(readFileSync(file));
const wasm = readFileSync(number === "float" ? "fracgyro-single.wasm" : "fracgyro.wasm");
const fracgyro = await load({ wasm, data: json("fracgyro.json") });
const controller = await fracgyro.controller(json(name));
const motions = new Float64Array(new Uint8Array(readFileSync("motion")).buffer);
const answers = [];
for (let n = 0; n < motions.length / 4; ++n) {
  const reported = Object.values(controller.report).flat();
  const [x, y, vx, vy] = motions.subarray(4 * n, 4 * n + 4);
  answers.push(...controller.step([x, y], [vx, vy]), ...reported);
}
writeFileSync("answer", Float64Array.from(answers));
