(() => {
  const of = (id) => document.getElementById(id);
  const data = JSON.parse(of("labels").textContent);
  const canvas = of("where"), pen = canvas.getContext("2d"), which = of("which"), told = of("told");
  const points = [], low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (let i = 0; i < data.points.length; i += 5) {
    const at = data.points.slice(i, i + 3).map((v) => v * data.unit_mm), code = data.points[i + 3];
    // Normals are folded onto a square of 64 × 64.
    let x = (code >> 6) / 31.5 - 1, y = (code & 63) / 31.5 - 1;
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
    const length = Math.hypot(x, y, z);
    points.push({ at, normal: [x / length, y / length, z / length], label: data.points[i + 4] });
    at.forEach((v, k) => { low[k] = Math.min(low[k], v); high[k] = Math.max(high[k], v); });
  }
  const middle = low.map((v, k) => (v + high[k]) / 2), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const size = canvas.width, scale = (0.96 * size) / Math.hypot(...low.map((v, k) => high[k] - v));
  const radius = Math.max(2, 1.1 * scale * Math.sqrt(data.area_mm2 / points.length));
  let turn = (data.view_deg[0] * Math.PI) / 180, rise = (data.view_deg[1] * Math.PI) / 180, seen = [];
  const draw = () => {
    const toward = [Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)];
    const right = [-Math.sin(turn), Math.cos(turn), 0];
    const up = [-Math.sin(rise) * Math.cos(turn), -Math.sin(rise) * Math.sin(turn), Math.cos(rise)];
    const chosen = Number(which.value), accent = getComputedStyle(canvas).getPropertyValue("--accent");
    seen = [];
    for (const { at, normal, label } of points) {
      const facing = dot(normal, toward);
      if (facing <= 0) continue;
      const from = at.map((v, k) => v - middle[k]);
      const x = size / 2 + scale * dot(from, right), y = size / 2 - scale * dot(from, up);
      seen.push({ x, y, depth: dot(from, toward), shade: 0.55 + 0.45 * facing, label });
    }
    seen.sort((a, b) => a.depth - b.depth);
    pen.clearRect(0, 0, size, size);
    for (const { x, y, shade, label } of seen) {
      const grey = chosen < 0 ? data.colours[label] : [140, 140, 140];
      pen.fillStyle = label === chosen ? accent : `rgb(${grey.map((v) => Math.round(v * shade)).join(" ")})`;
      pen.beginPath();
      pen.arc(x, y, radius, 0, 7);
      pen.fill();
    }
  };
  const tell = (label) => { told.textContent = label < 0 ? told.dataset.all : data.words[label]; };
  const choose = (label) => { which.value = label; tell(label); draw(); };
  which.addEventListener("change", () => choose(Number(which.value)));
  document.querySelectorAll("button.find").forEach((button) => button.addEventListener("click", () => {
    choose(Number(button.value));
    canvas.scrollIntoView({ block: "center" });
    which.focus({ preventScroll: true });
  }));
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!by) return;
    event.preventDefault();
    turn -= (by[0] * Math.PI) / 12;
    rise = Math.max(-1.57, Math.min(1.57, rise + (by[1] * Math.PI) / 12));
    draw();
  });
  let held = null;
  const place = (event) => {
    const box = canvas.getBoundingClientRect(), zoom = size / box.width;
    return [(event.clientX - box.left) * zoom, (event.clientY - box.top) * zoom];
  };
  canvas.addEventListener("pointerdown", (event) => {
    held = place(event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointerup", () => { held = null; });
  canvas.addEventListener("pointercancel", () => { held = null; });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    if (held) {
      turn -= (x - held[0]) / 150;
      rise = Math.max(-1.57, Math.min(1.57, rise + (y - held[1]) / 150));
      held = [x, y];
      draw();
    } else {
      const found = seen.findLast((point) => Math.hypot(point.x - x, point.y - y) < 1.5 * radius);
      tell(found ? found.label : Number(which.value));
    }
  });
  of("save").addEventListener("click", () => {
    const row = (point) => [...data.origin[point.label], ...point.at.map((v) => v.toFixed(2))].join(",");
    const text = ["object,cluster,x_mm,y_mm,z_mm", ...points.map(row)].join("\n") + "\n";
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = "labels.csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
