// The four pictures, drawn by Bokeh: plane, actions, error and spectrum, with a pinned run behind them.

import { extent, hold } from "./ranges.js";

const DASHES = [[], [6, 3], [2, 3], [8, 3, 2, 3]];
const LEAVING = 4;  // a run that leaves is shown up to so many times its start
const BEHIND = { line_alpha: 0.4, line_width: 1.2, visible: false };  // of a pinned run; what is not drawn costs nothing
const TICKS = [-10000, -1000, -100, -10, -1, 0, 1, 10, 100, 1000, 10000];

// Colours that differ, on light and dark paper: the palette of Okabe and Ito without black, more by their hue.
export function coloursOf(count) {
  const few = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1"];
  if (count <= few.length) return few.slice(0, count);
  return Array.from({ length: count }, (_, k) => `hsl(${Math.round(300 * k / count)}, 65%, 50%)`);
}

const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Pictures {
  constructor(facts, shown, colours) {
    Object.assign(this, { facts, shown, colours, behind: [], axes: [1, Math.min(2, facts.dimension)], pinned: null, transient: true });
    [this.N, this.D] = [facts.players.length, facts.dimension];
    this.flat = this.D === 1;
    this.views = {};
  }

  async build() {
    Bokeh.set_log_level("warn");
    if (!this.flat) await this.buildPlane();
    await this.buildLines();
    await this.buildError();
    await this.buildSpectrum();
    this.paint();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint());
  }

  figure(name, options) {
    const plot = Bokeh.Plotting.figure({
      tools: "", toolbar_location: null, sizing_mode: "stretch_both", min_border: 4, output_backend: "canvas",
      background_fill_color: null, border_fill_color: null, outline_line_color: null, ...options,
    });
    this.views[name] = { plot };
    return plot;
  }

  async show(name) {
    const made = this.views[name];
    made.view = await Bokeh.Plotting.show(made.plot, document.querySelector(`#${name} .plot`));
    const host = made.view.el;
    host.setAttribute("role", "img");
    host.setAttribute("aria-label", document.querySelector(`#${name} figcaption`).firstChild.textContent.trim());
    host.shadowRoot.querySelector(".bk-Canvas").tabIndex = -1;  // there is nothing to be done by keys in it
  }

  source(data) {
    return new Bokeh.ColumnDataSource({ data });
  }

  curves(plot, source, options = {}) {
    return plot.multi_line({ field: "xs" }, { field: "ys" }, {
      source, line_color: { field: "colour" }, line_dash: { field: "dash" }, line_width: this.N > 20 ? 0.8 : 1.8, ...options,
    });
  }

  async buildPlane() {
    const plot = this.figure("plane", { x_range: [0, 1], y_range: [0, 1] });
    this.plane = {
      plot, pinned: this.source({ xs: [], ys: [], colour: [], dash: [] }), paths: this.source({ xs: [], ys: [], colour: [], dash: [] }),
      edges: this.source({ xs: [], ys: [] }), rest: this.source({ x: [], y: [] }), players: this.source({ x: [], y: [], colour: [] }),
    };
    this.behind.push(this.curves(plot, this.plane.pinned, BEHIND));
    this.plane.graph = plot.multi_line({ field: "xs" }, { field: "ys" }, { source: this.plane.edges, line_alpha: 0.5, line_width: 1 });
    this.curves(plot, this.plane.paths);
    plot.scatter({ field: "x" }, { field: "y" }, {
      source: this.plane.players, size: 12, fill_color: { field: "colour" }, line_color: { field: "colour" }, line_width: 1.5,
    });
    this.plane.stars = plot.scatter({ field: "x" }, { field: "y" }, { source: this.plane.rest, marker: "x", size: 11, line_width: 2 });
    await this.show("plane");
  }

  async buildLines() {
    const plot = this.figure("lines", { x_range: [0, this.shown.stop], y_range: [0, 1], x_axis_label: "time (s)" });
    this.lines = {
      plot, pinned: this.source({ xs: [], ys: [], colour: [], dash: [] }), paths: this.source({ xs: [], ys: [], colour: [], dash: [] }),
      rest: this.source({ x: [], y: [], colour: [] }), cursor: new Bokeh.Span({ location: 0, dimension: "height", line_width: 1 }),
    };
    this.behind.push(this.curves(plot, this.lines.pinned, BEHIND));
    this.curves(plot, this.lines.paths);
    plot.scatter({ field: "x" }, { field: "y" }, { source: this.lines.rest, marker: "x", size: 9, line_width: 2, line_color: { field: "colour" } });
    plot.add_layout(this.lines.cursor);
    await this.show("lines");
  }

  async buildError() {
    const plot = this.figure("error", { x_range: [0, this.shown.stop], y_range: [1e-6, 1], y_axis_type: "log", x_axis_label: "time (s)" });
    this.error = {
      plot, pinned: this.source({ x: [], y: [] }), path: this.source({ x: [], y: [] }),
      cursor: new Bokeh.Span({ location: 0, dimension: "height", line_width: 1 }),
    };
    this.error.behind = plot.line({ field: "x" }, { field: "y" }, { source: this.error.pinned, line_width: 1.5, line_dash: [5, 3], visible: false });
    this.error.line = plot.line({ field: "x" }, { field: "y" }, { source: this.error.path, line_width: 1.8 });
    plot.add_layout(this.error.cursor);
    await this.show("error");
  }

  async buildSpectrum() {
    const plot = this.figure("spectrum", { x_range: [-6, 2], y_range: [-3, 3] });
    for (const axis of [...plot.below, ...plot.left]) {  // places are asinh(value), so that slow modes are seen beside fast ones
      axis.ticker = new Bokeh.FixedTicker({ ticks: TICKS.map(Math.asinh) });
      axis.major_label_overrides = new Map(TICKS.map(tick => [Math.asinh(tick), `${tick}`.replace("-", "−")]));
    }
    this.modes = { plot, pinned: this.source({ x: [], y: [] }), now: this.source({ x: [], y: [] }) };
    const unstable = new Bokeh.BoxAnnotation({ left: 0, fill_color: "#d03020", fill_alpha: 0.12, line_color: "#d03020", line_alpha: 0.6 });
    plot.add_layout(unstable);
    this.modes.behind = plot.scatter({ field: "x" }, { field: "y" }, { source: this.modes.pinned, size: 9, fill_alpha: 0, visible: false });
    this.modes.points = plot.scatter({ field: "x" }, { field: "y" }, { source: this.modes.now, marker: "x", size: 9, line_width: 1.8 });
    await this.show("spectrum");
  }

  // Colours of the paper in use, light or dark.
  paint() {
    const [text, line, quiet, accent] = ["--ink", "--line", "--quiet", "--accent"].map(ink);
    for (const { plot } of Object.values(this.views)) {
      for (const axis of [...plot.below, ...plot.left]) {
        axis.setv({
          axis_line_color: quiet, major_tick_line_color: quiet, minor_tick_line_color: null, major_label_text_color: text,
          axis_label_text_color: text, axis_label_text_font_style: "normal",
        });
      }
      for (const grid of plot.center.filter(each => each.type === "Grid")) grid.setv({ grid_line_color: line, grid_line_alpha: 0.6 });
    }
    this.error.line.glyph.line_color = accent;
    this.error.behind.glyph.line_color = quiet;
    this.modes.points.glyph.line_color = accent;
    this.modes.behind.glyph.line_color = quiet;
    this.lines.cursor.line_color = this.error.cursor.line_color = quiet;
    if (!this.flat) {
      this.plane.graph.glyph.line_color = quiet;
      this.plane.stars.glyph.line_color = text;
    }
  }

  paths(picture, place) {
    const data = { xs: [], ys: [], colour: [], dash: [] };
    for (let i = 1; i <= this.N; ++i) {
      for (const [x, y, dash] of place(i)) {
        data.xs.push(x);
        data.ys.push(y);
        data.colour.push(this.colours[i - 1]);
        data.dash.push(dash);
      }
    }
    return data;
  }

  inPlane(picture) {
    const [a, b] = this.axes;
    return this.paths(picture, i => [[picture.curve(i, a), picture.curve(i, b), DASHES[0]]]);
  }

  inTime(picture) {
    return this.paths(picture, i => Array.from({ length: this.D },
      (_, l) => [picture.time, picture.curve(i, l + 1), DASHES[l % DASHES.length]]));
  }

  players(value) {
    return Array.from({ length: this.N }, (_, k) => value(k + 1));
  }

  starts(l) {
    return this.players(i => this.shown.start(i, l));
  }

  // Draws a run; while a start is dragged the ranges stay.
  draw(picture, dragging = false) {
    this.picture = picture;
    const rest = l => this.players(i => picture.equilibrium(i, l));
    if (!this.flat) {
      this.plane.paths.data = this.inPlane(picture);
      this.plane.rest.data = { x: rest(this.axes[0]), y: rest(this.axes[1]) };
    }
    this.lines.paths.data = this.inTime(picture);
    const every = Array.from({ length: this.D }, (_, l) => rest(l + 1)).flat();
    this.lines.rest.data = {
      x: every.map(() => 0.995 * (this.transient ? this.settled : this.shown.stop)), y: every, colour: Array.from({ length: this.D }, () => this.colours).flat(),
    };
    this.error.path.data = { x: picture.time, y: picture.error };
    if (!dragging) this.fit();
    this.moment(Math.min(this.at ?? Infinity, this.shown.stop));
  }

  pin(picture, modes) {
    this.pinned = picture;
    for (const renderer of [...this.behind, this.error.behind, this.modes.behind]) renderer.visible = picture !== null;
    const none = { xs: [], ys: [], colour: [], dash: [] };
    if (!this.flat) this.plane.pinned.data = picture ? this.inPlane(picture) : none;
    this.lines.pinned.data = picture ? this.inTime(picture) : none;
    this.error.pinned.data = picture ? { x: picture.time, y: picture.error } : { x: [], y: [] };
    this.modes.pinned.data = modes ? this.placed(modes) : { x: [], y: [] };
    if (this.picture) this.fit();
  }

  fit() {
    const runs = this.pinned ? [this.picture, this.pinned] : [this.picture];
    const known = l => [...this.starts(l), ...this.players(i => this.picture.equilibrium(i, l))];
    const leaves = runs.some(({ error }) => error.at(-1) > LEAVING * error[0]);
    const limit = ls => !leaves ? Infinity : LEAVING * Math.max(1, ...ls.flatMap(known).filter(Number.isFinite).map(Math.abs));
    const reach = (ls, bound) => extent([...ls.map(known), ...runs.flatMap(run => ls.flatMap(l => this.players(i => run.curve(i, l))))], bound);
    const all = Array.from({ length: this.D }, (_, l) => l + 1);
    this.error.plot.x_range.setv({ start: 0, end: this.shown.stop });
    this.lines.plot.x_range.setv({ start: 0, end: this.transient ? this.settled : this.shown.stop });
    hold(this.lines.plot.y_range, reach(all, limit(all)));
    const [low, high] = extent(runs.map(run => run.error.filter(value => value > 0)), 1e12);
    const decades = [Math.log10(Math.max(low, high * 1e-14)), Math.log10(high)];
    const logarithms = { start: Math.log10(this.error.plot.y_range.start), end: Math.log10(this.error.plot.y_range.end),
      setv({ start, end }) { Object.assign(this, { start, end }); } };
    hold(logarithms, decades);
    this.error.plot.y_range.setv({ start: 10 ** logarithms.start, end: 10 ** logarithms.end });
    if (this.flat) return;
    const bound = limit(this.axes);
    hold(this.plane.plot.x_range, reach([this.axes[0]], bound));
    hold(this.plane.plot.y_range, reach([this.axes[1]], bound));
  }

  // A round time some while after the run has settled.
  get settled() {
    const time = 2 * (this.picture.figures?.settling_time || this.shown.stop);
    const power = 10 ** Math.floor(Math.log10(time));
    return Math.min(this.shown.stop, [1, 2, 5, 10].find(each => each * power >= time) * power);
  }

  placed({ real, imaginary }) {
    return { x: real.map(Math.asinh), y: imaginary.map(Math.asinh) };
  }

  spectrum(modes) {
    const placed = this.modes.now.data = this.placed(modes);
    if (!placed.x.length) return;
    hold(this.modes.plot.x_range, extent([placed.x, [0, Math.asinh(1)], this.modes.pinned.data.x]));
    const [, high] = extent([placed.y, [1], this.modes.pinned.data.y]);
    hold(this.modes.plot.y_range, [-high, high]);
  }

  // Players, their graph and the cursors at a time.
  moment(time) {
    this.at = time;
    this.lines.cursor.location = this.error.cursor.location = time;
    const { picture } = this;
    if (this.flat || !picture?.time.length) return;
    const k = sampleAt(picture.time, time);
    const place = l => this.players(i => picture.curve(i, l)[k]);
    const [x, y] = this.axes.map(place);
    this.plane.players.data = { x, y, colour: this.colours };
    const edges = { xs: [], ys: [] };
    for (let i = 1; i <= this.N; ++i) {
      for (let j = 1; j < i; ++j) {
        if (this.shown.weight(i, j) > 0 || this.shown.weight(j, i) > 0) {
          edges.xs.push([x[i - 1], x[j - 1]]);
          edges.ys.push([y[i - 1], y[j - 1]]);
        }
      }
    }
    this.plane.edges.data = edges;
  }
}

// Position of the last sample that is not after a time.
function sampleAt(times, time) {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}
