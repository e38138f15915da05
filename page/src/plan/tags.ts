/** Who is who: a pill beside each body with its name. Bodies on one spot share one: "Ana +9". */

import type { BodyFacts } from "../contract";
import { iconOf } from "../data/activities";
import type { Run } from "../data/run";
import type { Pose } from "../data/tracks";
import { type IconName, PATHS } from "../Icon";
import { pillColor } from "../theme";
import { bodyRadius, figureDisc } from "./bodies";
import type { Frame } from "./frame";
import { type Box, overlap } from "./labels";

type Context = CanvasRenderingContext2D;

const FONT = "600 11.5px system-ui, sans-serif";
const TALL = 20;
/** Room around a pill for its shadow [px]. */
const SOFT = 8;
/** Bodies nearer to each other than this share of a radius are on one spot. */
const TOGETHER = 0.8;
const EDGE = 2;
/** What somebody does is told by an icon before the name [px]. */
const ICON = 13;
const ICON_WIDE = 16;
/** The foot of a plan has a line of words, and the scale [px]. */
const FOOT = 20;

export interface TagScene {
  run: Run;
  us: number;
  poses: ReadonlyMap<string, Pose>;
  frame: Frame;
  /** The boxes of the names of rooms. */
  names: readonly Box[];
  width: number;
  height: number;
  selected: string;
}

interface Tag {
  stack: Stack;
  words: string;
  icon: IconName | null;
  /** Where it is; null where there is no place. */
  box: Box | null;
}

/** Bodies on one spot [px]; the first one names it. */
interface Stack {
  bodies: BodyFacts[];
  x: number;
  y: number;
  radius: number;
}

export class Tags {
  /** Pills that were drawn before: their shadows are costly. */
  private readonly pills = new Map<string, HTMLCanvasElement>();
  private readonly widths = new Map<string, number>();
  /** Which of its places each tag had last: it stays there while that is free. */
  private readonly last = new Map<string, number>();

  /** Draw a tag for each body for which there is a place; return how many bodies have none. */
  draw(context: Context, scene: TagScene): number {
    let hidden = 0;
    for (const tag of this.placed(context, scene)) {
      if (tag.box) this.drawPill(context, tag.box, tag);
      else hidden += tag.stack.bodies.length;
    }
    return hidden;
  }

  /** The box of each tag that covers neither a body nor another tag or name; null where there is none. */
  placed(context: Context, scene: TagScene): Tag[] {
    const stacks = stacksOf(scene);
    const taken: Box[] = [...scene.names];
    for (const { x, y, radius } of stacks) taken.push([x - radius, y - radius, x + radius, y + radius]);
    const { width, height } = scene;
    const isFree = (box: Box): boolean =>
      box[0] > EDGE && box[1] > EDGE && box[2] < width - EDGE && box[3] < height - FOOT && !taken.some((other) => overlap(box, other));
    return stacks.map((stack) => {
      const name = stack.bodies[0]!.name;
      const words = stack.bodies.length > 1 ? `${scene.run.label(name)} +${stack.bodies.length - 1}` : scene.run.label(name);
      const icon = iconFor(scene, stack);
      const places = placesBeside(stack, this.width(context, words) + (icon ? ICON_WIDE : 0));
      const before = this.last.get(name) ?? 0;
      const at = isFree(places[before]!) ? before : places.findIndex(isFree);
      if (at < 0) return { stack, words, icon, box: null };
      this.last.set(name, at);
      const box = places[at]!;
      taken.push(box);
      return { stack, words, icon, box };
    });
  }

  private width(context: Context, words: string): number {
    let width = this.widths.get(words);
    if (width === undefined) {
      context.font = FONT;
      this.widths.set(words, (width = Math.ceil(context.measureText(words).width) + 14));
    }
    return width;
  }

  private drawPill(context: Context, [left, top, right]: Box, { words, icon, stack }: Tag): void {
    const ratio = window.devicePixelRatio || 1;
    const { color } = stack.bodies[0]!;
    const key = `${words} ${icon} ${color} ${ratio}`;
    let pill = this.pills.get(key);
    if (!pill) this.pills.set(key, (pill = pillOf(words, icon, color, right - left, ratio)));
    context.drawImage(pill, Math.round(left) - SOFT, Math.round(top) - SOFT, pill.width / ratio, pill.height / ratio);
  }
}

/** Where bodies are, those on one spot together: who is selected first, then robots, then people. */
function stacksOf(scene: TagScene): Stack[] {
  const { run, selected } = scene;
  const rank = (body: BodyFacts): number => (body.name === selected ? 0 : body.robot ? 1 : 2);
  const stacks: Stack[] = [];
  for (const body of [...run.bodies].sort((one, other) => rank(one) - rank(other))) {
    const disc = figureDisc(scene, body);
    if (!disc) continue;
    const near = stacks.find(({ x, y }) => Math.hypot(x - disc.x, y - disc.y) < TOGETHER * bodyRadius(scene.frame, body));
    if (near) near.bodies.push(body);
    else stacks.push({ bodies: [body], ...disc });
  }
  return stacks;
}

/** What one person does; a crowd on one spot does different things. */
function iconFor({ run, us }: TagScene, { bodies }: Stack): IconName | null {
  const [body] = bodies;
  if (bodies.length > 1 || !body || body.robot) return null;
  const activity = run.events.last(body.name, "activity", us)?.detail;
  return activity ? iconOf(activity) : null;
}

/** Above, below, right, left, further above and below, and at the corners. */
function placesBeside({ x, y, radius }: Stack, wide: number): Box[] {
  const at = (left: number, top: number): Box => [left, top, left + wide, top + TALL];
  return [
    at(x - wide / 2, y - radius - TALL - 2),
    at(x - wide / 2, y + radius + 2),
    at(x + radius + 3, y - TALL / 2),
    at(x - radius - 3 - wide, y - TALL / 2),
    at(x - wide / 2, y - radius - 2 * TALL - 4),
    at(x - wide / 2, y + radius + TALL + 4),
    at(x + 2, y - radius - TALL - 2),
    at(x - wide - 2, y - radius - TALL - 2),
    at(x + 2, y + radius + 2),
    at(x - wide - 2, y + radius + 2),
  ];
}

function pillOf(words: string, icon: IconName | null, color: string, wide: number, ratio: number): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  canvas.width = Math.ceil((wide + 2 * SOFT) * ratio);
  canvas.height = Math.ceil((TALL + 2 * SOFT) * ratio);
  const context = canvas.getContext("2d")!;
  context.scale(ratio, ratio);
  context.save();
  context.shadowColor = "rgba(20, 20, 30, 0.28)";
  context.shadowBlur = 5 * ratio;
  context.shadowOffsetY = 1.5 * ratio;
  context.beginPath();
  context.roundRect(SOFT, SOFT, wide, TALL, TALL / 2);
  context.fillStyle = pillColor(color);
  context.fill();
  context.restore();
  context.font = FONT;
  context.textBaseline = "middle";
  context.fillStyle = "#ffffff";
  context.fillText(words, SOFT + 7 + (icon ? ICON_WIDE : 0), SOFT + TALL / 2 + 0.5);
  if (!icon) return canvas;
  context.translate(SOFT + 7, SOFT + (TALL - ICON) / 2);
  context.scale(ICON / 16, ICON / 16);
  context.lineCap = context.lineJoin = "round";
  context.lineWidth = 1.7;
  context.strokeStyle = "#ffffff";
  context.stroke(new Path2D(PATHS[icon]));
  return canvas;
}
