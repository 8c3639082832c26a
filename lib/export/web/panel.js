// The controls: playback, views, sliders, keys.
import { hold, held, position, release, sliderGroups } from "./sliders.js";

const $ = (id) => document.getElementById(id);
const VIEWS = ["avatar", "source", "dynamic", "static", "mouth"];

function make(tag, properties = {}, ...children) {
  const e = Object.assign(document.createElement(tag), properties);
  e.append(...children);
  return e;
}

export class Panel {
  constructor(player, names, moving, facts) {
    this.player = player;
    this.sliders = [];
    this.more = {};             // keys of others
    $("facts").textContent = facts;
    $("scrub").max = Math.max(0, player.motion.frames - 1);
    $("transport").classList.toggle("still", player.motion.frames < 2);
    $("play").disabled = $("scrub").disabled = $("speed").disabled =
      player.motion.frames < 2;
    this.addSliders(sliderGroups(names, moving));
    this.addPlayback();
    this.addViews();
    this.addKeys();
    if (innerWidth > 1000) this.open(true);
  }

  /* ---- sliders ---- */

  addSliders(groups) {
    for (const [title, list] of Object.entries(groups)) {
      const count = make("small");
      const group = make("details", { open: title === "Head" },
                         make("summary", {}, title, count));
      for (const s of list) group.append(this.row(s, group));
      group.count = count;
      group.addEventListener("toggle", () => this.refresh());
      $("face").append(group);
    }
    $("neutral").onclick = () => this.neutral();
    $("release").onclick = () => {
      this.player.motion.overrides.clear();
      this.touched();
    };
  }

  row(s, group) {
    const id = `s-${this.sliders.length}`;
    const input = make("input", { type: "range", id, min: s.min, max: s.max,
                                  step: s.step });
    const output = make("output", { htmlFor: id });
    const label = make("label", { htmlFor: id, textContent: s.label,
                                  title: s.name ?? s.label });
    const row = make("div", { className: "slider" }, label, input, output);
    const { overrides } = this.player.motion;
    input.oninput = () => { hold(s, overrides, Number(input.value)); this.touched(); };
    row.ondblclick = () => { release(s, overrides); this.touched(); };
    input.onkeydown = (e) => {
      if (e.key === "Delete" || e.key === "Backspace") row.ondblclick();
    };
    this.sliders.push({ s, row, input, output, group });
    return row;
  }

  // All of the face at rest, the head as it is.
  neutral() {
    for (const { s, group } of this.sliders)
      if (group.querySelector("summary").firstChild.data !== "Head")
        hold(s, this.player.motion.overrides, 0);
    this.touched();
  }

  touched() {
    this.player.changed("pose");
    this.refresh();
  }

  show(values) {
    this.values = values;
    const i = this.player.frame();
    if (document.activeElement !== $("scrub") || this.player.playing)
      $("scrub").value = i;
    $("scrub").setAttribute("aria-valuetext", `frame ${i}`);
    $("clock").textContent = `${this.player.motion.time(i).toFixed(2)} s · ${i}`;
    this.refresh();
  }

  refresh() {
    const { overrides } = this.player.motion;
    $("release").disabled = overrides.size === 0;
    if (!this.values || !$("panel").classList.contains("open")) return;
    const counts = new Map();
    for (const { s, row, input, output, group } of this.sliders) {
      const mine = held(s, overrides);
      if (mine) counts.set(group, (counts.get(group) ?? 0) + 1);
      if (!group.open) continue;
      const at = position(s, this.values);
      row.classList.toggle("held", mine);
      if (document.activeElement !== input || !mine) input.value = at;
      output.textContent = `${at.toFixed(s.step < 0.1 ? 2 : 1)}${s.suffix ?? ""}`;
    }
    for (const group of $("face").querySelectorAll("details"))
      group.count.textContent = counts.has(group) ? `${counts.get(group)} held` : "";
  }

  /* ---- playback ---- */

  addPlayback() {
    const { player } = this;
    $("play").onclick = () => player.play(!player.playing);
    $("scrub").oninput = () => { player.play(false); player.seek(Number($("scrub").value)); };
    $("speed").onchange = () => { player.speed = Number($("speed").value); };
    $("home").onclick = () => { player.view.reset(); player.changed("view"); };
    $("link").onclick = () => this.copy();
    $("more").onclick = () => this.open(!$("panel").classList.contains("open"));
  }

  playing(on) {
    $("play").classList.toggle("on", on);
    $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  open(on) {
    $("panel").classList.toggle("open", on);
    $("more").setAttribute("aria-expanded", on);
    this.refresh();
  }

  toast(text) {
    $("toast").textContent = text;
    $("toast").classList.add("on");
    clearTimeout(this.fading);
    this.fading = setTimeout(() => $("toast").classList.remove("on"), 2200);
  }

  async copy() {
    const link = this.player.link();
    this.player.play(false);
    history.replaceState(null, "", link);
    try {
      await navigator.clipboard.writeText(link);
      this.toast("Link to this frame copied");
    } catch {
      const field = make("textarea", { value: link });
      document.body.append(field);
      field.select();
      const copied = document.execCommand("copy");
      field.remove();
      this.toast(copied ? "Link to this frame copied"
                        : "The link is in the address bar");
    }
  }

  /* ---- views ---- */

  addViews() {
    const change = () => { this.apply(); this.player.stale = true; };
    for (const input of document.querySelectorAll("#panel section:first-child input"))
      input.addEventListener("input", change);
    $("any").addEventListener("click", () => { this.choose("background", "any"); change(); });
    this.views();
  }

  // What this avatar has to be shown.
  views() {
    const { view } = this.player;
    this.hide(this.radio("view", "source"), !view.rgb);
    this.hide(this.radio("background", "scene"), !view.back);
    this.hide($("photo"), !view.levels);
    this.apply();
  }

  radio(name, value) {
    return document.querySelector(`input[name=${name}][value="${value}"]`);
  }

  chosen(name) { return document.querySelector(`input[name=${name}]:checked`).value; }

  choose(name, value) {
    const input = this.radio(name, value);
    if (input && !input.disabled) input.checked = true;
  }

  hide(input, off) {
    input.disabled = off;
    input.closest("label").hidden = off;
  }

  // What the controls say becomes what is shown.
  apply() {
    const { show } = this.player.view, which = this.chosen("view");
    const branch = ["dynamic", "static", "mouth"].indexOf(which);
    const back = this.chosen("background");
    show.original = which === "source";
    show.branches = [0, 1, 2].map((b) => branch < 0 || b === branch ? 1 : 0);
    show.mesh = $("mesh").checked;
    show.photo = $("photo")?.checked ?? false;
    show.scenery = back === "scene";
    const color = { scene: "#000000", any: $("any").value }[back] ?? back;
    show.background.setRGB(...[1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255));
    $("stage").style.background = color;
  }

  state() {
    const back = this.chosen("background");
    return { view: this.chosen("view"), mesh: Number($("mesh").checked),
             photo: Number($("photo")?.checked ?? 1), speed: $("speed").value,
             background: back === "any" ? $("any").value.slice(1) : back.replace("#", "") };
  }

  restore({ view, mesh, photo, speed, background }) {
    if (VIEWS.includes(view)) this.choose("view", view);
    if (mesh) $("mesh").checked = mesh === "1";
    if (photo && $("photo")) $("photo").checked = photo === "1";
    if (["0.25", "0.5", "1", "2"].includes(speed)) {
      $("speed").value = speed;
      this.player.speed = Number(speed);
    }
    if (background === "scene") this.choose("background", "scene");
    if (/^[0-9a-f]{6}$/.test(background ?? "")) {
      if (this.radio("background", `#${background}`))
        this.choose("background", `#${background}`);
      else {
        $("any").value = `#${background}`;
        this.choose("background", "any");
      }
    }
    this.apply();
    this.player.stale = true;
  }

  /* ---- keys ---- */

  addKeys() {
    addEventListener("keydown", (e) => {
      const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(e.target.tagName);
      const button = e.target.tagName === "BUTTON" || e.target.tagName === "SUMMARY";
      if (e.ctrlKey || e.altKey || e.metaKey || (typing && e.key !== "Escape")) return;
      if (button && (e.key === " " || e.key === "Enter")) return;
      if (this.key(e.key, e.shiftKey)) e.preventDefault();
    });
  }

  key(key, shift) {
    const { player } = this, step = Math.PI / 36;
    const toggle = (id) => { $(id)?.click(); return true; };
    const turn = (across, up) => { player.view.turn(across, up); return true; };
    const go = (i) => { player.play(false); player.seek(i); return true; };
    if (shift && key.startsWith("Arrow"))
      return { ArrowLeft: () => turn(-step, 0), ArrowRight: () => turn(step, 0),
               ArrowUp: () => turn(0, -step), ArrowDown: () => turn(0, step) }[key]();
    const plain = {
      " ": () => toggle("play"), ArrowLeft: () => go(player.frame() - 1),
      ArrowRight: () => go(player.frame() + 1), Home: () => go(0),
      End: () => go(player.motion.frames - 1), 0: () => toggle("home"),
      "+": () => player.view.zoom(1 / 1.15), "=": () => player.view.zoom(1 / 1.15),
      "-": () => player.view.zoom(1.15), w: () => toggle("mesh"),
      t: () => toggle("photo"), l: () => toggle("link"), p: () => toggle("more"),
      Escape: () => { this.open(false); return true; },
    };
    VIEWS.forEach((name, i) => {
      plain[i + 1] = () => { this.radio("view", name).click(); return true; };
    });
    const act = { ...plain, ...this.more }[key.length === 1 ? key.toLowerCase() : key];
    return act ? (act(), true) : false;
  }
}
