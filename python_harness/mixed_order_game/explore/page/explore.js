// The page of a game: what is changed goes to the server, and what comes back is drawn.

import { controls, element } from "./controls.js";
import { Graph } from "./graph.js";
import { Handles } from "./handles.js";
import { Pictures, coloursOf } from "./pictures.js";
import { Playback } from "./playback.js";
import { ask, keep, latest, pictureOf } from "./server.js";
import { Shown } from "./shown.js";

const $ = id => document.getElementById(id);

const FIGURES = [
  ["settling_time", "settled to 2 % after", "s"], ["overshoot", "overshoot", ""], ["final_error", "largest |x − x*|, last fifth", ""],
  ["control_energy", "control energy", ""], ["control_peak", "largest control", ""],
];

const facts = await (await fetch("game")).json();
const shown = new Shown(facts, location.hash);
const colours = coloursOf(facts.players.length);
const pictures = new Pictures(facts, shown, colours);
await pictures.build();

let asked = 0, wished = null, current = null, modes = null, pinned = null;

const problem = text => {
  $("problem").textContent = text ?? "";
  $("problem").hidden = !text;
};
const failed = error => problem(error instanceof TypeError ? "The server of this page does not answer: has mog explore ended?" : error.message);

const run = latest("run", response => pictureOf(response, facts), (picture, wish) => {
  problem(picture.problem);
  if (picture.time.length) {
    current = picture;
    pictures.draw(picture, handles.dragging);
    handles.place();
    figures();
  }
  requestAnimationFrame(() => setTimeout(() => {  // after it was painted, so that the two do not wait for each other
    spectrum(wish);
    if (wish !== wished) return;
    $("pictures").setAttribute("aria-busy", "false");
    const { duration } = performance.measure("change to picture", { start: asked });
    $("pace").textContent = `Answered in ${Math.round(duration)} ms.`;
    document.body.dataset.drawn = shown.text;
  }));
}, failed);

const spectrum = latest("spectrum", response => response.json(), found => {
  modes = found.problem ? { real: [], imaginary: [], verdict: "not computed", reason: found.problem } : found;
  $("badge").dataset.verdict = modes.verdict;
  $("verdict").textContent = modes.verdict;
  $("reason").textContent = modes.reason;
  pictures.spectrum(modes);
}, failed);

const showControls = controls(facts, shown, changed);
const graph = new Graph(facts, shown, colours, () => changed());
const handles = new Handles(facts, shown, pictures, colours, changed);
const playback = new Playback(shown, time => pictures.moment(time));

let settling = 0;

// The address follows when changes pause: browsers bear few new ones a second.
function keepAddress() {
  clearTimeout(settling);
  settling = setTimeout(() => history.replaceState(null, "", shown.address), 200);
}

// Called after every change: shows it everywhere and asks for its run.
function changed() {
  asked = performance.now();
  showControls();
  showPlayer();
  graph.show();
  handles.place();
  $("stop").value = shown.stop;
  $("command").textContent = shown.command;
  $("no-pushes").hidden = document.querySelector('[data-file=".csv"]').hidden = shown.pushes.length === 0;
  $("pushes").textContent = shown.pushes.length
    ? shown.pushes.map(([time, i, l, size, duration]) => `d_ext[${i},${l}] = ${size} from ${time} s for ${duration} s`).join("; ")
    : "d_ext at the time shown, while it plays or not";
  $("claims").classList.add("earlier");
  keepAddress();
  $("pictures").setAttribute("aria-busy", "true");
  wished = shown.wish;
  run(wished);
}

function figures() {
  const digits = (run, name) => run?.figures?.[name] == null ? "–" : `${Number(run.figures[name].toPrecision(3))}`;
  document.querySelector("#figures .pinned").hidden = pinned === null;
  document.querySelector("#figures tbody").replaceChildren(...FIGURES.map(([name, told, unit]) => element("tr", {},
    element("th", { scope: "row", textContent: told + (unit && `, ${unit}`) }), element("td", { textContent: digits(current, name) }),
    ...(pinned ? [element("td", { textContent: digits(pinned, name) })] : []))));
}

const player = () => Number($("player").value);

function showPlayer() {
  const fields = $("starts").querySelectorAll("input");
  fields.forEach((field, k) => { field.value = shown.start(player(), k + 1); });
}

function pin(picture, found, text) {
  pinned = picture;
  shown.pinned = picture && text;
  pictures.pin(picture, found);
  $("pin").textContent = picture ? "Take the pin off" : "Pin this run";
  $("pin").setAttribute("aria-pressed", String(picture !== null));
  keepAddress();
  figures();
}

// The run that the address names as pinned.
async function pinAgain(text) {
  const { wish } = new Shown(facts, text);
  const [picture, found] = await Promise.all([
    ask("run", wish).then(response => pictureOf(response, facts)), ask("spectrum", wish).then(response => response.json()),
  ]);
  if (picture.time.length) pin(picture, found.problem ? null : found, text);
}

$("title").textContent = facts.title;
document.title = `${facts.title}: mog explore`;
$("pictures").toggleAttribute("data-flat", pictures.flat);
for (const id of ["player", "coordinate"]) {
  const names = id === "player" ? facts.players.map((name, k) => `${k + 1}: ${name}`) : Array.from({ length: facts.dimension }, (_, l) => `${l + 1}`);
  $(id).append(...names.map((textContent, k) => element("option", { value: k + 1, textContent })));
}
$("coordinate-label").hidden = facts.dimension === 1;
$("starts").append(...Array.from({ length: facts.dimension }, (_, l) => {
  const field = element("input", { type: "number", step: "any" });
  field.addEventListener("change", () => {
    shown.set(`x0[${player()},${l + 1}]`, field.valueAsNumber);
    changed();
  });
  return element("label", { className: "line" }, facts.dimension > 1 ? `start, coordinate ${l + 1}` : "start", field);
}));
$("player").addEventListener("change", () => {
  showPlayer();
  handles.show(player());
});
$("stop").addEventListener("change", () => {
  const ended = playback.atEnd;
  shown.stop = $("stop").valueAsNumber;
  playback.at(ended ? shown.stop : playback.time);
  changed();
});
$("push-now").addEventListener("click", () => {
  const time = playback.atEnd ? 0 : Number(playback.time.toPrecision(3));
  shown.pushes.push([time, player(), Number($("coordinate").value), $("size").valueAsNumber, $("duration").valueAsNumber]);
  if (playback.atEnd) playback.play();
  changed();
});
$("no-pushes").addEventListener("click", () => {
  shown.pushes = [];
  changed();
});
$("pin").addEventListener("click", () => pinned ? pin(null, null) : current && pin(current, modes, shown.text));
$("reset").addEventListener("click", () => {
  shown.read("");
  pin(null, null);
  changed();
});
$("copy").addEventListener("click", async () => {
  const copied = await navigator.clipboard.writeText(shown.command).then(() => true, () => false);
  if (!copied) getSelection().selectAllChildren($("command"));
  $("copy").textContent = copied ? "Copied" : "Selected: copy it with Ctrl-C";
  setTimeout(() => { $("copy").textContent = "Copy as command"; }, 1500);
});
for (const button of document.querySelectorAll("[data-file]")) {
  button.addEventListener("click", () => {
    const name = button.dataset.file === ".csv" ? "pushes" : (facts.name.replace(/.*[/\\]|\.\w+$/g, "") || "five_vehicles") + "_explored";
    keep(button.dataset.file, shown.wish, name).catch(failed);
  });
}
$("judge").addEventListener("click", async () => {
  $("judge").disabled = true;
  $("claims-summary").textContent = "Judging …";
  const found = await ask("claims", shown.wish).then(response => response.json()).catch(error => ({ problem: error.message }));
  $("judge").disabled = false;
  $("claims-summary").textContent = found.problem ?? found.summary;
  $("claims").classList.remove("earlier");
  $("claims").replaceChildren(...(found.claims ?? []).flatMap(claim => [
    element("dt", {}, element("span", { className: claim.verdict in { holds: 1, fails: 1 } ? claim.verdict : "open" }, claim.verdict), ` ${claim.statement}`),
    element("dd", { className: "quiet" }, claim.reason),
  ]));
});
for (const button of document.querySelectorAll("[data-picture]")) {
  button.hidden = pictures.flat && button.dataset.picture === "plane";
  button.addEventListener("click", () => choose(button.dataset.picture));
}
function choose(name) {
  $("pictures").dataset.shown = name;
  for (const button of document.querySelectorAll("[data-picture]")) button.setAttribute("aria-pressed", String(button.dataset.picture === name));
}
choose(pictures.flat ? "lines" : "plane");
$("plane").hidden = pictures.flat;
$("lines-hint").textContent = pictures.flat ? "drag a start, or use the arrow keys" : ["solid", "dashed", "dotted", "dash-dotted"].slice(0, facts.dimension).map((dash, l) => `${l + 1} ${dash}`).join(", ");
const pairs = [[1, 2], [1, 3], [2, 3]].filter(([, b]) => b <= facts.dimension);
$("axes").append(...pairs.map(pair => element("option", { value: pair, textContent: pair.join(" and ") })));
$("axes-label").hidden = pairs.length < 2;
$("axes").addEventListener("change", () => {
  pictures.axes = $("axes").value.split(",").map(Number);
  pictures.draw(current);
  pictures.pin(pinned, pinned && modes);
  handles.place();
});
$("transient").addEventListener("change", () => {
  pictures.transient = $("transient").checked;
  if (current) pictures.draw(current);
});
addEventListener("hashchange", () => {
  shown.read(location.hash);
  changed();
});
window.explored = { shown, pictures };  // for the console of the browser
const named = shown.pinned;
handles.show(player());
playback.at(shown.stop);
changed();
if (named !== null) pinAgain(named).catch(failed);
