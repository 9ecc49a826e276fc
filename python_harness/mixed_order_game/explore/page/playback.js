// Moves through the time of the run, of whatever length, in about twelve seconds.

const SECONDS = 12;

export class Playback {
  constructor(shown, show) {
    Object.assign(this, { shown, show, playing: false, time: shown.stop });
    this.button = document.getElementById("play");
    this.slider = document.getElementById("moment");
    this.button.addEventListener("click", () => this.playing ? this.pause() : this.play());
    this.slider.addEventListener("input", () => {
      this.pause();
      this.at(Number(this.slider.value) * this.shown.stop);
    });
    this.at(this.time);
  }

  at(time) {
    this.time = Math.min(time, this.shown.stop);
    this.slider.value = this.time / this.shown.stop;
    const text = `${this.time.toPrecision(3)} s`;
    document.getElementById("moment-text").textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
    this.show(this.time);
  }

  get atEnd() {
    return this.time >= this.shown.stop;
  }

  play() {
    if (this.atEnd) this.at(0);
    this.playing = true;
    this.button.textContent = "Pause";
    let before = performance.now();
    const frame = now => {
      if (!this.playing) return;
      const time = this.time + (now - before) / 1000 * this.shown.stop / SECONDS;
      before = now;
      this.at(time);
      if (this.atEnd) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.button.textContent = "Play";
  }
}
