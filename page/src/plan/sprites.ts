/** Figures that were drawn before, turned to where they look: in a crowd, one copy is cheaper than eight shapes. */

import { drawPerson, drawRobot, type Look, type Posture } from "./figures";

type Context = CanvasRenderingContext2D;

/** Steps are shown in so many phases. */
const PHASES = 8;
/** A figure reaches this far from its middle [radii]: who lies is longest. */
const REACH = 4.2;
/** Larger figures are drawn anew, as they would be coarse when turned [px]. */
const LARGEST_PX = 26;
const SHARPER = 2;
const MOST_SPRITES = 600;

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
  const { x, y, heading, radius, posture } = figure;
  context.save();
  context.translate(x, y);
  context.scale(1, -1);
  context.rotate(heading);
  if (radius > LARGEST_PX) drawShapes(context, figure, figure.step);
  else {
    const reach = (posture === "lie" ? REACH : REACH / 2) * radius;
    context.drawImage(spriteOf(figure, reach), -reach, -reach, 2 * reach, 2 * reach);
  }
  context.restore();
}

function spriteOf(figure: Figure, reach: number): HTMLCanvasElement {
  const { color, radius, posture } = figure;
  const ratio = SHARPER * (window.devicePixelRatio || 1);
  const phase = Math.round(figure.step * PHASES);
  const key = `${color} ${posture} ${phase} ${radius.toFixed(1)} ${ratio}`;
  let sprite = sprites.get(key);
  if (!sprite) {
    if (sprites.size >= MOST_SPRITES) sprites.clear();
    sprite = document.createElement("canvas");
    sprite.width = Math.ceil(2 * reach * ratio);
    sprite.height = sprite.width;
    const context = sprite.getContext("2d")!;
    context.scale(ratio, ratio);
    context.translate(reach, reach);
    drawShapes(context, figure, phase / PHASES);
    sprites.set(key, sprite);
  }
  return sprite;
}

/** Draw in pixels, x where the figure looks. Shapes are given in metres: here a metre is a pixel. */
function drawShapes(context: Context, { color, radius, posture }: Figure, step: number): void {
  const look: Look = { color, radius, step };
  if (posture === null) drawRobot(context, look, null, 2);
  else drawPerson(context, { ...look, radius: 1.1 * radius }, posture, 2);
}
