// Sliders on logarithmic scales, fields and switches: each sets one variable of the FMU.

const DECADES = 2;

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const short = value => Number(value.toPrecision(3));

// A slider from a hundredth to a hundredfold of the game's own value, and a field for any number.
function gain(control, shown, changed) {
  const middle = Math.log10(control.start > 0 ? control.start : 1);
  const slider = element("input", { type: "range", min: middle - DECADES, max: middle + DECADES, step: 0.01 });
  const field = element("input", { type: "number", step: "any" });
  const unit = control.unit.replaceAll("s2", "s²");
  const told = unit ? `${control.name} in ${unit}` : control.name;
  slider.setAttribute("aria-label", told);
  field.setAttribute("aria-label", `${told}, as a number`);
  slider.dataset.name = field.dataset.name = control.name;
  const show = () => {
    const value = shown.value(control.name);
    slider.value = Math.log10(Math.max(value, 1e-300));
    field.value = value;
    slider.setAttribute("aria-valuetext", `${value} ${unit}`);
  };
  slider.addEventListener("input", () => {
    const there = Number(slider.value);
    shown.set(control.name, Math.abs(there - middle) < 0.006 && control.start > 0 ? control.start : short(10 ** there));
    show();
    changed();
  });
  field.addEventListener("change", () => {
    shown.set(control.name, field.valueAsNumber);
    show();
    changed();
  });
  const row = element("label", { className: "gain", title: control.meaning }, told.replace(" in ", ", "), slider, field);
  return [row, show];
}

function number(control, shown, changed) {
  const field = element("input", { type: "number", step: "any" });
  field.dataset.name = control.name;
  field.addEventListener("change", () => {
    shown.set(control.name, field.valueAsNumber);
    changed();
  });
  const row = element("label", { className: "line", title: control.meaning }, control.name, field);
  return [row, () => { field.value = shown.value(control.name); }];
}

function toggle(control, shown, changed) {
  const box = element("input", { type: "checkbox" });
  box.dataset.name = control.name;
  box.addEventListener("change", () => {
    shown.set(control.name, box.checked);
    changed();
  });
  return [element("label", { className: "line", title: control.meaning }, box, control.name),
    () => { box.checked = shown.value(control.name); }];
}

const stemOf = control => control.name.replace(/\[.*/, "");

// Fills the page; returns a function that shows all values.
export function controls(facts, shown, changed) {
  const shows = [];
  const put = (parent, make, control) => {
    const [row, show] = make(control, shown, changed);
    parent.append(row);
    shows.push(show);
  };
  const gains = document.getElementById("gains");
  for (const stem of new Set(facts.gains.map(stemOf))) {
    const members = facts.gains.filter(control => stemOf(control) === stem);
    if (members.length === 1) {
      put(gains, gain, members[0]);
      continue;
    }
    const group = element("details", { open: members.length <= 3 }, element("summary", {}, `${stem} of each player`));
    gains.append(group);
    for (const control of members) put(group, gain, control);
  }
  for (const control of facts.switches) put(document.getElementById("run"), toggle, control);
  const parameters = document.getElementById("parameters");
  parameters.hidden = facts.parameters.length === 0;
  for (const control of facts.parameters) put(parameters, number, control);
  return () => shows.forEach(show => show());
}
