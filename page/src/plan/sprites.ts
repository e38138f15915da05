/** Figures that were drawn before, as they look somewhere: in a crowd, one copy is cheaper than eight shapes. */

import { drawPerson, drawRobot, type Look, type Posture } from "./figures";

type Context = CanvasRenderingContext2D;

/** Steps and turns are shown in so many phases: a copy that needn't be turned or scaled is the cheapest one. */
const PHASES = 4;
const TURNS = 72;
/** A figure reaches this far from its middle [radii]: who lies is longest. */
const REACH = 4.2;
/** Larger figures are drawn anew, as their phases would be seen [px]. */
const LARGEST_PX = 26;
const MOST_SPRITES = 2000;

const sprites = new Map<string, HTMLCanvasElement>();

export interface Figure {
  x: number;
  y: number;
  /** Where it looks [rad], counter-clockwise. */
  heading: number;
  /** Its radius [px]. */
  radius: number;
  color: string;
  /** Where a step is, from -1 to 1. */
  step: number;
  /** How it is; null is a robot. */
  posture: Posture | null;
}

export function drawFigure(context: Context, figure: Figure): void {
  const { x, y, radius } = figure;
  if (radius > LARGEST_PX) {
    context.save();
    context.translate(x, y);
    drawTurned(context, figure);
    context.restore();
    return;
  }
  const ratio = window.devicePixelRatio || 1;
  const sprite = spriteOf(figure, ratio);
  const reach = sprite.width / 2;
  context.drawImage(sprite, Math.round(x * ratio - reach) / ratio, Math.round(y * ratio - reach) / ratio, sprite.width / ratio, sprite.width / ratio);
}

function spriteOf(figure: Figure, ratio: number): HTMLCanvasElement {
  const { color, radius, posture, heading } = figure;
  const phase = Math.round(figure.step * PHASES);
  const turn = Math.round((heading * TURNS) / (2 * Math.PI)) % TURNS;
  const key = `${color} ${posture} ${phase} ${turn} ${radius.toFixed(1)} ${ratio}`;
  let sprite = sprites.get(key);
  if (!sprite) {
    if (sprites.size >= MOST_SPRITES) sprites.clear();
    const reach = (posture === "lie" ? REACH : REACH / 2) * radius;
    sprite = document.createElement("canvas");
    sprite.width = 2 * Math.ceil(reach * ratio);
    sprite.height = sprite.width;
    const context = sprite.getContext("2d")!;
    context.translate(sprite.width / 2, sprite.width / 2);
    context.scale(ratio, ratio);
    drawTurned(context, { ...figure, step: phase / PHASES, heading: (turn * 2 * Math.PI) / TURNS });
    sprites.set(key, sprite);
  }
  return sprite;
}

function drawTurned(context: Context, figure: Figure): void {
  context.scale(1, -1);
  context.rotate(figure.heading);
  drawShapes(context, figure);
}

/** Draw in pixels, x where the figure looks. Shapes are given in metres: here a metre is a pixel. */
function drawShapes(context: Context, { color, radius, posture, step }: Figure): void {
  const look: Look = { color, radius, step };
  if (posture === null) drawRobot(context, look, null, 2);
  else drawPerson(context, { ...look, radius: 1.1 * radius }, posture, 2);
}
