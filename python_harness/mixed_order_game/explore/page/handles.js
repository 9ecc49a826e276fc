// The players' starts as handles over a picture: dragged, or moved by the arrow keys.

const FEW = 12;  // players up to which each has a handle; of more the chosen one
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Handles {
  constructor(facts, shown, pictures, colours, changed) {
    Object.assign(this, { facts, shown, pictures, colours, changed, made: new Map(), dragging: false });
    this.name = pictures.flat ? "lines" : "plane";
    this.parent = document.querySelector(`#${this.name} .plot`);
    new ResizeObserver(() => requestAnimationFrame(() => this.place())).observe(this.parent);
  }

  get frame() {
    return this.pictures.views[this.name].view.frame;
  }

  // Coordinates that a handle moves, null for the time.
  get axes() {
    return this.pictures.flat ? [null, 1] : this.pictures.axes;
  }

  show(player) {
    const wanted = this.facts.players.length <= FEW ? this.facts.players.map((_, k) => k + 1) : [player];
    for (const [i, handle] of this.made) {
      if (!wanted.includes(i)) {
        handle.remove();
        this.made.delete(i);
      }
    }
    for (const i of wanted) {
      if (!this.made.has(i)) this.made.set(i, this.handle(i));
    }
    this.place();
  }

  handle(i) {
    const handle = document.createElement("div");
    Object.assign(handle, { className: "handle", textContent: i, tabIndex: 0 });
    handle.style.setProperty("--colour", this.colours[i - 1]);
    handle.setAttribute("role", "slider");
    handle.setAttribute("aria-label", `start of player ${i}, ${this.facts.players[i - 1]}`);
    handle.dataset.player = i;
    handle.addEventListener("pointerdown", event => {
      handle.setPointerCapture(event.pointerId);
      this.dragging = true;
      event.preventDefault();
      handle.focus();
    });
    handle.addEventListener("pointermove", event => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const box = this.parent.getBoundingClientRect();
      const [x, y] = [this.frame.x_scale.invert(event.clientX - box.left), this.frame.y_scale.invert(event.clientY - box.top)];
      this.move(i, [x, y]);
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      handle.addEventListener(kind, () => {
        this.dragging = false;
        this.changed();
      });
    }
    handle.addEventListener("keydown", event => {
      const way = KEYS[event.key];
      if (!way) return;
      event.preventDefault();
      const far = event.shiftKey ? 50 : 5;
      this.move(i, this.axes.map((l, k) => (l ? this.shown.start(i, l) : 0) + far * way[k] * this.step(k)));
    });
    this.parent.append(handle);
    return handle;
  }

  // A round number of about a five hundredth of an axis.
  step(k) {
    const { start, end } = [this.frame.x_range, this.frame.y_range][k];
    return 10 ** Math.round(Math.log10((end - start) / 500));
  }

  move(i, [x, y]) {
    [x, y].forEach((value, k) => {
      const l = this.axes[k];
      if (l === null) return;
      const step = this.step(k);
      const digits = Math.max(0, -Math.round(Math.log10(step)));
      this.shown.set(`x0[${i},${l}]`, Number((Math.round(value / step) * step).toFixed(digits)));
    });
    this.place();
    this.changed();
  }

  place() {
    if (!this.pictures.views[this.name].view) return;
    const { x_scale, y_scale } = this.frame;
    for (const [i, handle] of this.made) {
      const [x, y] = this.axes.map(l => l === null ? 0 : this.shown.start(i, l));
      const told = this.axes.filter(l => l !== null).map(l => `${this.shown.start(i, l)}`).join(", ");
      handle.style.left = `${x_scale.compute(x)}px`;
      handle.style.top = `${y_scale.compute(y)}px`;
      handle.setAttribute("aria-valuenow", this.shown.start(i, this.axes[1]));
      handle.setAttribute("aria-valuetext", told);
      handle.title = `start of ${this.facts.players[i - 1]}: ${told}`;
    }
  }
}
