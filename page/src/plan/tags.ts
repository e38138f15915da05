/** Who is who: a pill beside each body with its name, and what is said. */

import type { BodyFacts } from "../contract";
import type { Run } from "../data/run";
import type { Pose } from "../data/tracks";
import { title } from "../data/words";
import { mix } from "../theme";
import { bodyRadius } from "./bodies";
import type { Frame } from "./frame";
import { type Box, overlap } from "./labels";

type Context = CanvasRenderingContext2D;

const FONT = "600 11.5px system-ui, sans-serif";
const TALL = 20;

export function drawTags(
  context: Context,
  run: Run,
  poses: ReadonlyMap<string, Pose>,
  frame: Frame,
  names: readonly Box[],
  width: number,
  height: number,
): void {
  const taken: Box[] = [...names];
  const present: [BodyFacts, number, number, number][] = [];
  for (const body of run.bodies) {
    const pose = poses.get(body.name);
    if (!pose || pose.away) continue;
    const [x, y, radius] = [frame.ux(pose.x), frame.uy(pose.y), 1.35 * bodyRadius(frame, body)];
    present.push([body, x, y, radius]);
    taken.push([x - radius, y - radius, x + radius, y + radius]);
  }
  context.font = FONT;
  context.textBaseline = "middle";
  context.textAlign = "left";
  for (const [body, x, y, radius] of present) {
    const words = title(body.name);
    const wide = context.measureText(words).width + 14;
    const isFree = (box: Box): boolean =>
      box[0] > 2 && box[1] > 2 && box[2] < width - 2 && box[3] < height - 2 && !taken.some((other) => overlap(box, other));
    const places = placesBeside(x, y, radius, wide);
    const box = places.find(isFree) ?? places[0]!;
    taken.push(box);
    drawPill(context, box, words, body.color);
  }
}

/** Above, below, right, left, and further above. */
function placesBeside(x: number, y: number, radius: number, wide: number): Box[] {
  const at = (left: number, top: number): Box => [left, top, left + wide, top + TALL];
  return [
    at(x - wide / 2, y - radius - TALL - 2),
    at(x - wide / 2, y + radius + 2),
    at(x + radius + 3, y - TALL / 2),
    at(x - radius - 3 - wide, y - TALL / 2),
    at(x - wide / 2, y - radius - 2 * TALL - 4),
    at(x - wide / 2, y + radius + TALL + 4),
  ];
}

function drawPill(context: Context, [left, top, right, bottom]: Box, words: string, color: string): void {
  context.save();
  context.shadowColor = "rgba(20, 20, 30, 0.28)";
  context.shadowBlur = 5;
  context.shadowOffsetY = 1.5;
  context.beginPath();
  context.roundRect(left, top, right - left, bottom - top, TALL / 2);
  context.fillStyle = mix(color, "#000000", 0.08);
  context.fill();
  context.restore();
  context.fillStyle = "#ffffff";
  context.fillText(words, left + 7, (top + bottom) / 2 + 0.5);
}
