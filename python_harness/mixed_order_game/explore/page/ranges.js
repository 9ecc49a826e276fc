// Ranges of axes that hold still while curves move: they grow at once and shrink when most of them is empty.

const SHRINK = 0.45, MARGIN = 0.07;

export function extent(arrays, limit = Infinity) {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) {
    for (const value of array) {
      if (value < low && value >= -limit) low = value;
      if (value > high && value <= limit) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

export function hold(range, [low, high], margin = MARGIN) {
  const span = high - low || Math.abs(high) || 1;
  const [start, end] = [low - margin * span, high + margin * span];
  const fits = start >= range.start - 1e-9 * span && end <= range.end + 1e-9 * span;
  if (fits && end - start > SHRINK * (range.end - range.start)) return;
  range.setv({ start, end });
}
