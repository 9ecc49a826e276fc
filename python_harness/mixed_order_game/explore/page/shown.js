// What the page shows, as differences from the game's own values; the address after # holds it.

const numbers = text => text.split(",").map(Number);

export class Shown {
  constructor(facts, text = "") {
    this.facts = facts;
    this.own = new Map([
      ...[...facts.gains, ...facts.switches, ...facts.parameters].map(control => [control.name, control.start]),
      ...Object.entries(facts.edges), ...Object.entries(facts.x0),
    ]);
    this.read(text);
  }

  read(text) {
    this.changes = new Map();
    this.pushes = [];
    this.stop = this.facts.stop_time;
    this.pinned = null;
    for (const part of text.replace(/^#/, "").split("&").filter(part => part.includes("="))) {
      const [name, value] = [part.slice(0, part.indexOf("=")), part.slice(part.indexOf("=") + 1)].map(decodeURIComponent);
      if (name === "push") this.pushes.push(numbers(value));
      else if (name === "stop") this.stop = Number(value);
      else if (name === "pinned") this.pinned = value;
      else this.set(name, value === "true" || value === "false" ? value === "true" : Number(value));
    }
  }

  value(name) {
    return this.changes.has(name) ? this.changes.get(name) : this.own.get(name);
  }

  set(name, value) {
    if (value === this.own.get(name)) this.changes.delete(name);
    else this.changes.set(name, value);
  }

  get wish() {
    return { changes: Object.fromEntries(this.changes), pushes: this.pushes, stop_time: this.stop };
  }

  // The shown values alone; what is pinned is added by address().
  get text() {
    return [
      ...[...this.changes].map(([name, value]) => `${name}=${value}`),
      ...this.pushes.map(push => `push=${push}`),
      ...(this.stop === this.facts.stop_time ? [] : [`stop=${this.stop}`]),
    ].join("&");
  }

  get address() {
    const pinned = this.pinned === null ? [] : [`pinned=${encodeURIComponent(this.pinned)}`];
    return "#" + [this.text, ...pinned].filter(part => part !== "").join("&");
  }

  get command() {
    const quoted = word => /^[\w.,=:/+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
    return [
      "mog", "run", ...(this.facts.name ? [this.facts.name] : []),
      ...[...this.changes].flatMap(([name, value]) => ["--set", `${name}=${value}`]),
      ...(this.stop === this.facts.stop_time ? [] : ["--stop-time", `${this.stop}`]),
      ...(this.pushes.length ? ["--disturbance", "pushes.csv"] : []),
    ].map(quoted).join(" ");
  }

  weight(i, j) {  // with which i hears j
    const name = this.facts.directed || i < j ? `a[${i},${j}]` : `a[${j},${i}]`;
    return this.value(name) ?? 0;
  }

  start(i, l) {
    return this.value(`x0[${i},${l}]`);
  }
}
