// The report: one video whose left half is the driver and whose right half is
// the result, drawn over each other with a wipe; the charts follow its time.
(() => {
  const box = document.getElementById("wipe");
  const charts = [...document.querySelectorAll("svg.chart")];
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
      const { from, to, left, right } = c.dataset;
      const share = t / (to - from || 1);
      const x = Number(left) + Math.min(1, share) * (right - left);
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
      const r = c.getBoundingClientRect(), { from, to, left, right } = c.dataset;
      const x = (e.clientX - r.left) / r.width * c.viewBox.baseVal.width;
      const share = Math.max(0, Math.min(1, (x - left) / (right - left)));
      seek(share * (to - from));
    });
})();
