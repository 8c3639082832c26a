// The report: one video whose left half is the driver and whose right half is
// the result, drawn over each other with a wipe; the charts follow its time.
(() => {
  const box = document.getElementById("wipe");
  const charts = [...document.querySelectorAll("svg.chart")];
  const wide = 560, high = 200, left = 52, right = wide - 16, top = 30, foot = high - 34;

  // Colours that people with any kind of colour vision tell apart (Okabe and
  // Ito 2008), and dashes besides.
  const looks = { driver: ["#0072b2", "none"], result: ["#d55e00", "7 2"],
                  truth: ["#008060", "2 3"], "null line": ["#6b6b6b", "1 4"] };

  // lo, hi: all values, between round ends (1, 2 or 5 times a power of ten).
  function scale(values) {
    let lo = Math.min(...values), hi = Math.max(...values);
    if (!values.length) lo = hi = 0;
    const least = Math.max(Math.abs(lo), 1e-3);
    if (!(hi - lo > 1e-6 * least)) hi = lo + least;
    const ten = 10 ** Math.floor(Math.log10((hi - lo) / 4)), rest = (hi - lo) / 4 / ten;
    const step = ten * (rest < 1.5 ? 1 : rest < 3.5 ? 2 : rest < 7.5 ? 5 : 10);
    return { lo: Math.floor(lo / step + 1e-9) * step, hi: Math.ceil(hi / step - 1e-9) * step, step };
  }

  function chart(svg) {
    const { x, curves } = JSON.parse(svg.nextElementSibling.textContent);
    const { lo, hi, step } = scale(Object.values(curves).flat().filter((v) => v !== null));
    const from = x[0] ?? 0, to = x.at(-1) ?? 1;
    const across = (t) => (left + (t - from) / (to - from || 1) * (right - left)).toFixed(1);
    const up = (v) => (foot + (v - lo) / (hi - lo) * (top - foot)).toFixed(1);
    let s = "";
    for (let k = 0; k <= Math.round((hi - lo) / step); k++) {
      const y = up(lo + k * step);
      s += `<path d="M${left} ${y}H${right}" stroke="#ddd"/><text x="${left - 6}" y="${y}" dy="4"
        text-anchor="end">${Number((lo + k * step).toPrecision(3))}</text>`;
    }
    Object.entries(curves).forEach(([name, ys], i) => {
      const look = `stroke="${(looks[name] ?? looks.driver)[0]}" stroke-dasharray="${(looks[name] ?? looks.driver)[1]}"`;
      const d = ys.map((v, k) => v === null ? "" :
        `${k && ys[k - 1] !== null ? "L" : "M"}${across(x[k])} ${up(v)}`).join("");
      s += `<path fill="none" stroke-width="2" d="${d}" ${look}/>
        <path stroke-width="3" d="M${left + 116 * i} 12h26" ${look}/>
        <text x="${left + 32 + 116 * i}" y="16">${name}</text>`;
    });
    svg.setAttribute("viewBox", `0 0 ${wide} ${high}`);
    svg.innerHTML = `${s}<text x="${left}" y="${high - 14}">${Number(from.toPrecision(3))}</text>
      <text x="${right}" y="${high - 14}" text-anchor="end">${Number(to.toPrecision(3))} s</text>
      <line class="now" x1="${left}" x2="${left}" y1="${top}" y2="${foot}"/>`;
    Object.assign(svg.dataset, { from, to });
  }

  charts.forEach(chart);
  if (!box) return;
  const $ = (id) => document.getElementById(id);
  const video = box.querySelector("video"), canvas = box.querySelector("canvas");
  const screen = box.querySelector(".screen"), mark = box.querySelector("i");
  const ink = canvas.getContext("2d");
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;

  function draw() {
    const S = canvas.width, at = Math.round($("line").value / 100 * S);
    mark.style.left = `${$("line").value}%`;
    if (video.readyState < 2) return;
    ink.drawImage(video, S, 0, S, S, 0, 0, S, S);
    if (at > 0) ink.drawImage(video, 0, 0, at, S, 0, 0, at, S);
  }

  function show() {
    const t = video.currentTime;
    draw();
    $("time").value = video.duration ? t / video.duration : 0;
    $("time").setAttribute("aria-valuetext", `${t.toFixed(2)} seconds`);
    $("clock").textContent = `${t.toFixed(2)} s`;
    for (const c of charts) {
      const share = t / (c.dataset.to - c.dataset.from || 1);
      const x = left + Math.min(1, share) * (right - left);
      c.querySelector(".now").setAttribute("x1", x);
      c.querySelector(".now").setAttribute("x2", x);
    }
  }

  function follow() {
    show();
    if (!video.paused) requestAnimationFrame(follow);
  }

  // In the middle of a frame, so that rounding does not show its neighbour.
  function seek(t) {
    const rate = Number(box.dataset.rate);
    video.pause();
    video.currentTime = (Math.floor(t * rate + 1e-6) + 0.5) / rate;
  }

  function toggle() {
    if (video.paused) video.play(); else video.pause();
  }

  function wipe(e) {
    const r = screen.getBoundingClientRect();
    $("line").value = 100 * (e.clientX - r.left) / r.width;
    draw();
  }

  video.addEventListener("play", () => { $("play").textContent = "Pause"; follow(); });
  video.addEventListener("pause", () => { $("play").textContent = "Play"; });
  video.addEventListener("seeked", show);
  function begin() {
    document.body.classList.add("timed");
    video.addEventListener("seeked", () => {
      if (!still) video.play().catch(() => {});
    }, { once: true });
    seek(0);            // without it some browsers show nothing yet
  }

  if (video.readyState >= 2) begin();
  else video.addEventListener("loadeddata", begin, { once: true });
  video.addEventListener("error", () => { $("unplayed").hidden = false; });
  $("line").addEventListener("input", draw);
  $("time").addEventListener("input", () => seek($("time").value * video.duration));
  $("play").addEventListener("click", toggle);
  screen.addEventListener("pointerdown", (e) => { screen.setPointerCapture(e.pointerId); wipe(e); });
  screen.addEventListener("pointermove", (e) => { if (e.buttons) wipe(e); });
  for (const c of charts)
    c.addEventListener("click", (e) => {
      const r = c.getBoundingClientRect(), { from, to } = c.dataset;
      const x = (e.clientX - r.left) / r.width * c.viewBox.baseVal.width;
      const share = Math.max(0, Math.min(1, (x - left) / (right - left)));
      seek(share * (to - from));
    });
})();
