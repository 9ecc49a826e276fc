// The communication graph on a circle: an edge, or two players one after the other, toggles.

const SVG = "http://www.w3.org/2000/svg";
const RADIUS = 92;
const ALL_PAIRS = 8;  // players up to which edges that are absent are shown, too
const MOST_STOPS = 60;  // edges up to which the keyboard stops at each; players always

function drawn(tag, attributes, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

export class Graph {
  constructor(facts, shown, colours, changed) {
    Object.assign(this, { facts, shown, colours, changed, chosen: null });
    this.svg = document.getElementById("graph");
    this.hint = document.getElementById("graph-hint");
    const N = facts.players.length;
    this.size = Math.max(2.5, Math.min(11, 250 / N));
    this.place = Array.from({ length: N }, (_, k) => {
      const angle = 2 * Math.PI * k / N - Math.PI / 2;
      return [RADIUS * Math.cos(angle), RADIUS * Math.sin(angle)];
    });
    this.edges = drawn("g", {});
    this.nodes = drawn("g", {}, ...facts.players.map((name, k) => this.node(name, k + 1)));
    this.svg.append(this.edges, this.nodes);
    this.say();
  }

  say(text) {
    const pair = this.facts.directed ? "who is heard, then who hears," : "two players";
    this.hint.textContent = text ?? `Choose an edge, or ${pair} to add or remove the edge between them.`;
  }

  node(name, i) {
    const [x, y] = this.place[i - 1];
    const made = drawn("g", {
      class: "node", tabindex: 0, role: "button", "aria-pressed": "false", "aria-label": `player ${i}, ${name}`, "data-player": i,
    }, drawn("circle", { cx: x, cy: y, r: this.size, fill: this.colours[i - 1] }));
    if (this.size >= 6) made.append(Object.assign(drawn("text", { x, y }), { textContent: i }));
    this.press(made, () => this.choose(i));
    return made;
  }

  press(made, act) {
    made.addEventListener("click", act);
    made.addEventListener("keydown", event => {
      if (event.key === "Enter" || event.key === " ") {
        event.preventDefault();
        act();
      }
    });
  }

  choose(i) {
    const first = this.chosen;
    this.chosen = first === null ? i : null;
    for (const node of this.nodes.children) {
      node.setAttribute("aria-pressed", String(this.chosen === Number(node.dataset.player)));
    }
    this.say(this.chosen === null ? undefined : `Player ${i} and …?`);
    if (first !== null && first !== i) this.toggle(this.facts.directed ? `a[${i},${first}]` : `a[${Math.min(i, first)},${Math.max(i, first)}]`);
  }

  toggle(name) {
    if (!(name in this.facts.edges)) {
      this.say(`The FMU has no edge ${name}: of games as large as this one only their own edges are variables.`);
      return;
    }
    const own = this.facts.edges[name];
    this.shown.set(name, this.shown.value(name) > 0 ? 0 : own > 0 ? own : 1);
    this.changed();
  }

  show() {
    const every = this.facts.players.length <= ALL_PAIRS;
    const weights = Object.keys(this.facts.edges).map(name => [name, this.shown.value(name)]).filter(([, weight]) => weight > 0 || every);
    const told = JSON.stringify(weights);
    if (told === this.told) return;
    this.told = told;
    const focused = document.activeElement?.dataset?.edge;
    this.svg.style.setProperty("--width", Math.min(2, 150 / weights.length));
    const made = weights.map(([name, weight]) => this.edge(name, weight, weights.length <= MOST_STOPS));
    this.edges.replaceChildren(...made);
    if (focused) made.find(each => each.dataset.edge === focused)?.focus();
  }

  edge(name, weight, stop) {
    const [i, j] = name.match(/\d+/g).map(Number);  // i hears j
    const [[x1, y1], [x2, y2]] = [this.place[j - 1], this.place[i - 1]];
    const bend = this.facts.directed ? 0.12 : 0;
    const [cx, cy] = [(x1 + x2) / 2 - bend * (y2 - y1), (y1 + y2) / 2 + bend * (x2 - x1)];
    const d = `M${x1} ${y1}Q${cx} ${cy} ${x2} ${y2}`;
    const told = this.facts.directed ? `${i} hears ${j}` : `edge ${i}-${j}`;
    const group = drawn("g", {
      class: "edge", tabindex: stop ? 0 : -1, role: "switch", "aria-checked": String(weight > 0), "data-edge": name,
      "aria-label": weight > 0 && weight !== 1 ? `${told}, weight ${weight}` : told,
    }, Object.assign(drawn("title", {}), { textContent: `${name} = ${weight}` }),
    drawn("path", { class: "hit", d }), drawn("path", { class: "drawn", d }));
    if (this.facts.directed) {
      const length = Math.hypot(x2 - cx, y2 - cy), [ux, uy] = [(x2 - cx) / length, (y2 - cy) / length];
      const [tx, ty] = [x2 - this.size * ux, y2 - this.size * uy];
      const [bx, by] = [tx - 7 * ux, ty - 7 * uy];
      group.append(drawn("path", { class: "arrow", d: `M${tx} ${ty}L${bx - 3.5 * uy} ${by + 3.5 * ux}L${bx + 3.5 * uy} ${by - 3.5 * ux}Z` }));
    }
    this.press(group, () => this.toggle(name));
    return group;
  }
}
