// The image of the camera, with detections drawn on it.

const CLASS_COLOURS = { glass: "#35c3ff", plate: "#ffd166", box: "#7ae582", prism: "#7ae582", brick: "#ff8fab" };

export class CameraPanel {
  constructor(at) {
    this.canvas = at("picture");
    this.empty = at("no-camera");
    this.facts = at("camera-facts");
    this.bitmap = null;
    this.size = [1, 1];
    this.detections = null;
    this.times = [];
    this.isDecoding = false;
    this.next = null;
  }

  // Shows an image; while one is decoded, the newest of the others waits and the rest is left out.
  async show(size, jpeg) {
    this.next = [size, jpeg];
    if (this.isDecoding) return;
    this.isDecoding = true;
    while (this.next) {
      const [{ width, height }, bytes] = this.next;
      this.next = null;
      const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" })).catch(() => null);
      if (!bitmap) continue;
      this.bitmap?.close();
      this.bitmap = bitmap;
      this.size = [width, height];
      const now = performance.now();
      this.times = [...this.times.filter((time) => now - time < 3000), now];
      this.draw();
    }
    this.isDecoding = false;
  }

  setDetections(detections) {
    this.detections = detections;
    if (this.bitmap) this.draw();
  }

  draw() {
    const { canvas, bitmap } = this;
    canvas.hidden = false;
    this.empty.hidden = true;
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    const paint = canvas.getContext("2d");
    paint.drawImage(bitmap, 0, 0);
    const objects = this.detections?.objects ?? [];
    const rate = this.times.length > 1 ? (this.times.length - 1) / ((this.times.at(-1) - this.times[0]) / 1000) : 0;
    this.facts.textContent = `${this.size[0]} × ${this.size[1]} · ${rate.toFixed(1)}/s` + (objects.length ? ` · ${objects.length} detected` : "");
    const [width, height] = this.detections?.image ?? this.size;
    const scale = [bitmap.width / width, bitmap.height / height];
    paint.lineWidth = 2;
    paint.font = "600 13px system-ui, sans-serif";
    for (const { id, class: kind, confidence, polygon } of objects) {
      if (!polygon.length) continue;
      const corners = polygon.map(([u, v]) => [(u + 0.5) * scale[0], (v + 0.5) * scale[1]]);
      const colour = CLASS_COLOURS[kind] ?? "#ffffff";
      paint.beginPath();
      for (const [x, y] of corners) paint.lineTo(x, y);
      paint.closePath();
      paint.strokeStyle = colour;
      paint.fillStyle = `${colour}22`;
      paint.fill();
      paint.stroke();
      const label = `${kind}${id === null ? "" : ` ${id}`}${confidence === null ? "" : ` ${Math.round(confidence * 100)} %`}`;
      const x = Math.min(...corners.map(([x]) => x)), y = Math.min(...corners.map(([, y]) => y)) - 6;
      const wide = paint.measureText(label).width + 8;
      paint.fillStyle = colour;
      paint.fillRect(x - 1, y - 13, wide, 18);
      paint.fillStyle = "#0b1015";
      paint.fillText(label, x + 3, y + 1);
    }
  }
}
