/** The home at a moment as a small picture: for cards, answers and what is under the pointer. */

import type { Run } from "../data/run";
import { colors } from "../theme";
import { Backdrop } from "./backdrop";
import { drawScene, posesAt } from "./bodies";
import { Frame } from "./frame";

export const THUMBNAIL = { width: 168, height: 104 } as const;
const RATIO = 2;
/** Around somebody a picture shows so much [m]. */
const AROUND_M = 9;
const SHOWN: ReadonlySet<string> = new Set(["sight", "lights", "furniture"]);

const backdrops = new WeakMap<Run, Backdrop[]>();

/** One backdrop for whole homes, and one for parts of them: so neither draws the ground of the other anew. */
function backdropOf(run: Run, part: 0 | 1): Backdrop {
  let both = backdrops.get(run);
  if (!both) backdrops.set(run, (both = [new Backdrop(run), new Backdrop(run)]));
  return both[part]!;
}

/** Draw the home at a moment; with `focus`, the part of it around that body. */
export function drawThumbnail(canvas: HTMLCanvasElement, run: Run, us: number, focus = ""): void {
  const { width, height } = THUMBNAIL;
  const context = canvas.getContext("2d")!;
  context.setTransform(RATIO, 0, 0, RATIO, 0, 0);
  context.clearRect(0, 0, width, height);
  const poses = posesAt(run, us);
  const whole = Frame.fit(run.home, width, height);
  const at = poses.get(focus);
  const isPart = at !== undefined && !at.away && whole.scale * AROUND_M < width;
  const frame = isPart ? Frame.around(run.home, width, height, run.home.metres(at.x, 0), run.home.metres(at.y, 1), width / AROUND_M) : whole;
  const stage = { frame, width, height, ratio: RATIO, colors: colors.value, withFurniture: true, withLight: true };
  context.drawImage(backdropOf(run, isPart ? 1 : 0).picture(stage, us), 0, 0, width, height);
  drawScene(context, { run, us, poses, frame, colors: colors.value, selected: "", steps: false, shows: (name) => SHOWN.has(name), other: null, smallest: isPart ? 8 : 4 });
}
