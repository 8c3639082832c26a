// What the parts of the player take out of the archive (lib/export/page.c).
import { Motion } from "./motion.js";
import { texelsFor } from "./view.js";

// What the worker needs, copied out of the archive.
export function drivenArrays(a, count) {
  return {
    shaped: a.planes("shaped"), expDirs: a.planes("exp_dirs"),
    poseDirs: a.planes("pose_dirs"), lids: a.planes("lids"),
    weights: a.planes("weights"), joints: a.array("joints"),
    jointExp: a.array("joint_exp"), parents: a.array("parents"),
    faces: a.array("faces"), lipInner: a.array("lip_inner"),
    chinVertices: a.array("chin_vertices"),
    rides: a.array("rides"), mean: a.planes("mean"), bend: a.planes("bend"),
    counts: a.array("counts"), pivot: a.array("pivot"),
    shoulders: a.array("shoulders"), lip: a.array("lip"),
    ...(a.has("jaw") ? { jaw: a.planes("jaw"), chin: a.array("chin") } : {}),
    ...(a.has("view") ? { view: a.array("view") } : {}),
    ...(a.has("reach") ? { reach: a.array("reach") } : {}),
    texels: texelsFor(count),
  };
}

// What is drawn; the photograph where there is one.
export function drawnArrays(a, count) {
  const g = {
    count, counts: a.array("counts"), scale: a.planes("scale"),
    quat: a.planes("quat"), opacity: a.planes("opacity"),
    color: a.planes("color"), faces: a.array("faces"),
    vertices: a.shape("weights")[1],
  };
  if (a.has("rgb")) Object.assign(g, { rgb: a.picture("rgb", 3),
                                       matte: a.picture("matte", 1) });
  if (a.has("back")) g.back = a.picture("back", 3);
  if (a.has("uv")) Object.assign(g, { uv: a.planes("uv"), seen: a.planes("seen"),
                                      tilt: a.planes("tilt"),
                                      view: a.array("view"),
                                      pivot: a.array("pivot"),
                                      shoulders: a.array("shoulders"),
                                      light: [0, 0, 0], lamp: [0, 0, 0, 1, 1, 1] });
  if (a.has("around")) Object.assign(g, { around: a.planes("around"),
                                          grain: a.picture("grain", 1) });
  if (a.has("normal")) Object.assign(g, { normal: a.planes("normal"),
                                          light: a.array("light"),
                                          lamp: a.array("lamp") });
  return g;
}

// The drive; without one the source's own pose, a single frame.
export function motionOf(a) {
  const [frames, width] = a.shape("motion");
  if (frames) return new Motion(a.array("motion"), a.array("time"), width);
  const still = a.has("source") ? a.array("source") : new Float32Array(width);
  if (!a.has("source")) still.set([1, 0, 0, 0, -1, 0, 0, 0, -1, 0, 0, 12]);
  return new Motion(still, new Float64Array(1), width);
}
