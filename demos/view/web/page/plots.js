// Lines over time on a canvas.

const SECONDS = 20;
const MARGIN = { left: 44, right: 12, top: 8, bottom: 22 };

export const COLOURS = ["#2f7ed8", "#e8743b", "#19a979", "#bf399e", "#8c6bd1", "#c29b1d", "#13a4b4"];

export class Plot {
  samples = [];

  constructor(section) {
    this.canvas = section.querySelector("canvas");
    this.isSeen = true;
    new IntersectionObserver(([entry]) => (this.isSeen = entry.isIntersecting)).observe(this.canvas);
  }

  add(time, values) {
    if (!values) return;
    // After a restart of the source its time may be earlier.
    if (this.samples.length && time < this.samples.at(-1).time) this.samples = [];
    this.samples.push({ time, values });
    while (this.samples[0].time < time - SECONDS - 1) this.samples.shift();
  }

  draw() {
    if (!this.isSeen) return;
    const ratio = Math.min(devicePixelRatio, 2);
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const paint = this.canvas.getContext("2d");
    paint.setTransform(ratio, 0, 0, ratio, 0, 0);
    paint.clearRect(0, 0, width, height);
    const box = { left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: height - MARGIN.bottom };
    const [low, high, step] = this.range(box.bottom - box.top);
    const now = this.samples.at(-1)?.time ?? 0;
    const x = (time) => box.right - (now - time) / SECONDS * (box.right - box.left);
    const y = (value) => box.bottom - (value - low) / (high - low) * (box.bottom - box.top);
    const css = getComputedStyle(this.canvas);
    paint.font = `11px ${css.fontFamily}`;
    paint.lineWidth = 1;
    paint.fillStyle = css.getPropertyValue("color");
    paint.globalAlpha = 0.65;
    paint.textAlign = "right";
    paint.textBaseline = "middle";
    for (let value = Math.ceil(low / step) * step; value <= high + step / 1e6; value += step) {
      paint.fillText(String(+value.toFixed(6)), box.left - 6, y(value));
    }
    paint.textAlign = "center";
    paint.textBaseline = "alphabetic";
    for (let back = 0; back <= SECONDS; back += 5) paint.fillText(back ? `-${back} s` : "now", Math.min(x(now - back), box.right - 10), height - 6);
    paint.globalAlpha = 0.12;
    paint.strokeStyle = css.getPropertyValue("color");
    paint.beginPath();
    for (let value = Math.ceil(low / step) * step; value <= high + step / 1e6; value += step) {
      paint.moveTo(box.left, y(value));
      paint.lineTo(box.right, y(value));
    }
    paint.stroke();
    paint.globalAlpha = 1;
    paint.lineWidth = 1.6;
    paint.lineJoin = "round";
    // A point for every two pixels; which samples are drawn does not change while they move.
    const slotSeconds = SECONDS / (box.right - box.left) * 2;
    const newest = this.samples.at(-1);
    const count = newest?.values.length ?? 0;
    paint.save();
    paint.beginPath();
    paint.rect(box.left, 0, box.right - box.left, height);
    paint.clip();
    for (let line = 0; line < count; line += 1) {
      paint.strokeStyle = COLOURS[line % COLOURS.length];
      paint.beginPath();
      let drawn = NaN;
      for (const sample of this.samples) {
        const slot = Math.floor(sample.time / slotSeconds);
        if (slot === drawn && sample !== newest) continue;
        drawn = slot;
        paint.lineTo(x(sample.time), y(sample.values[line]));
      }
      paint.stroke();
    }
    paint.restore();
  }

  // Range of the values and a round step between lines.
  range(pixels) {
    let low = Infinity, high = -Infinity;
    for (const { values } of this.samples) {
      for (const value of values) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    if (low > high) [low, high] = [0, 1];
    const room = Math.max((high - low) * 0.06, 0.5);
    [low, high] = [low - room, high + room];
    const rough = (high - low) / Math.max(2, pixels / 34);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
    return [low, high, step];
  }
}
