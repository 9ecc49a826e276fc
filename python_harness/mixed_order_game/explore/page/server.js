// Asks the server: the newest wish alone, and what it answers as typed arrays.

const SLOW = 300;  // ms after which a run that is outdated is given up

export async function ask(path, wish, signal) {
  const response = await fetch(path, {
    method: "POST", body: JSON.stringify(wish), headers: { "Content-Type": "application/json" }, signal,
  });
  if (!response.ok) throw new Error(await response.text());
  return response;
}

// A function that asks, and calls show(answer, wish); wishes that come while one is out wait, the newest alone.
export function latest(path, read, show, fail) {
  let waiting = null, out = null, since = 0;
  async function send(wish) {
    out = new AbortController();
    since = performance.now();
    try {
      const answer = await read(await ask(path, wish, out.signal));
      show(answer, wish);
    } catch (error) {
      if (error.name !== "AbortError") fail(error);
    }
    out = null;
    if (waiting !== null) {
      const next = waiting;
      waiting = null;
      send(next);
    }
  }
  return wish => {
    if (out === null) {
      send(wish);
      return;
    }
    waiting = wish;
    if (performance.now() - since > SLOW) out.abort();
  };
}

// The packed picture: length of the head, head in JSON, then 32-bit floats.
export async function pictureOf(response, facts) {
  const buffer = await response.arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const { samples, problem, figures } = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let place = 4 + length;
  const floats = count => {
    place += 4 * count;
    return new Float32Array(buffer, place - 4 * count, count);
  };
  const [N, D] = [facts.players.length, facts.dimension];
  const equilibrium = floats(N * D), time = floats(samples), error = floats(samples);
  const curves = Array.from({ length: N * D }, () => floats(samples));
  return {
    problem, figures, time, error, curves,
    curve: (i, l) => curves[(i - 1) * D + l - 1],
    equilibrium: (i, l) => equilibrium[(i - 1) * D + l - 1],
  };
}

export async function keep(suffix, wish, name) {
  const response = await ask(`file${suffix}`, wish);
  if (response.headers.get("Content-Type").startsWith("application/json")) throw new Error((await response.json()).problem);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = name + suffix;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
