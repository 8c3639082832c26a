// A link to what is shown: the frame, the camera, the view, what is held.

const camera = (view) => [...view.camera.position.toArray(),
                          ...view.orbit.target.toArray()];
const short = (x) => Number(x.toFixed(4));

export function toLink(player) {
  const { view, panel, motion } = player;
  const parts = new URLSearchParams();
  parts.set("frame", player.frame());
  parts.set("camera", camera(view).map(short).join(","));
  for (const [key, value] of Object.entries(panel.state())) parts.set(key, value);
  const held = [...motion.overrides].map(([k, v]) => `${k}:${short(v)}`);
  if (held.length) parts.set("held", held.join(","));
  return `#${parts.toString().replaceAll("%2C", ",").replaceAll("%3A", ":")
    .replaceAll("%23", "")}`;
}

// Whether the link said anything.
export function fromLink(player, hash) {
  const parts = new URLSearchParams(hash.slice(1));
  const { view, panel, motion } = player;
  const numbers = (text) => text.split(",").map(Number);
  if (![...parts.keys()].length) return false;
  const held = parts.get("held");
  motion.overrides.clear();
  for (const pair of held ? held.split(",") : []) {
    const [k, v] = pair.split(":").map(Number);
    if (Number.isInteger(k) && k >= 0 && k < motion.width - 6 && Number.isFinite(v))
      motion.overrides.set(k, v);
  }
  const at = numbers(parts.get("camera") ?? "");
  if (at.length === 6 && at.every(Number.isFinite)) {
    view.camera.position.fromArray(at);
    view.orbit.target.fromArray(at, 3);
    view.orbit.update();
  }
  panel.restore(Object.fromEntries(parts));
  player.play(false);
  player.seek(Number(parts.get("frame")) || 0);
  player.changed("view");
  return true;
}
