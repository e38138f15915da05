/** Floors of rooms: what they are made of follows from the type of the room. Drawn in metres. */

import { LOOK } from "../contract";
import type { Home } from "../data/home";
import { mix } from "../theme";

type Context = CanvasRenderingContext2D;
type Box = readonly [left: number, bottom: number, right: number, top: number];

const { pitch: PLANK_M, joint: JOINT_M, colors: WOOD } = LOOK.planks;
const CARPET = LOOK.carpet.colors;
const CARPETED: ReadonlySet<string> = new Set(LOOK.carpet.rooms);
const TILES: Record<string, { color: string; pitch: number } | undefined> = LOOK.tiles;
/** In homes larger than this, floors are plain [m²]: their pattern would be finer than a pixel. */
const MOST_PATTERNED_M2 = 2500;

/** Where planks are narrower than this, floors are plain [px]. */
const LEAST_PX = 2;
/** Dots of carpets, which aren't drawn where they are smaller than a pixel. */
const DOT_M = 0.025;
const DOTS_PER_M2 = 200;

/** Numbers from 0 to 1 that are the same for the same seed, so that a floor looks the same each time. */
function drawsOf(seed: number): () => number {
  let state = (Math.abs(Math.round(seed)) % 2147483646) + 1;
  return () => {
    state = (state * 16807) % 2147483647;
    return state / 2147483647;
  };
}

export function drawFloors(context: Context, home: Home): void {
  const { rooms, area_m2: area } = home.facts;
  const scale = context.getTransform().a;
  const isPlain = area > MOST_PATTERNED_M2 || PLANK_M * scale < LEAST_PX;
  rooms.forEach((room, i) => {
    const floor = home.floors[i]!;
    context.save();
    context.clip(floor.path);
    const seed = floor.box[0] * 100 + floor.box[1] * 10;
    const tiles = TILES[room.type];
    if (room.type === "unknown") fill(context, floor.box, LOOK.unknown);
    else if (isPlain) fill(context, floor.box, tiles?.color ?? (CARPETED.has(room.type) ? CARPET[i % CARPET.length]! : WOOD[0]!));
    else if (tiles) drawTiles(context, floor.box, tiles.color, tiles.pitch, drawsOf(seed + 5));
    else if (CARPETED.has(room.type)) drawCarpet(context, floor.box, CARPET[i % CARPET.length]!, DOT_M * scale < 1 ? 0 : DOTS_PER_M2, drawsOf(seed + 9));
    else drawPlanks(context, floor.box, drawsOf(seed + 3));
    context.restore();
  });
}

function fill(context: Context, [left, bottom, right, top]: Box, color: string): void {
  context.fillStyle = color;
  context.fillRect(left, bottom, right - left, top - bottom);
}

/** Planks lie along the longer side. */
function drawPlanks(context: Context, box: Box, draw: () => number): void {
  const [left, bottom, right, top] = box;
  fill(context, box, WOOD[0]!);
  const lieAlong = right - left > top - bottom;
  const [from, to, start, end] = lieAlong ? [bottom, top, left, right] : [left, right, bottom, top];
  for (let across = from; across < to; across += PLANK_M) {
    for (let along = start - draw() * 1.6; along < end; ) {
      const length = 0.9 + draw() * 1.1;
      context.fillStyle = WOOD[Math.floor(draw() * WOOD.length)]!;
      const [wide, narrow] = [length - JOINT_M, PLANK_M - JOINT_M];
      if (lieAlong) context.fillRect(along, across, wide, narrow);
      else context.fillRect(across, along, narrow, wide);
      along += length;
    }
  }
}

function drawCarpet(context: Context, box: Box, color: string, dotsPerM2: number, draw: () => number): void {
  const [left, bottom, right, top] = box;
  fill(context, box, color);
  const dots = (right - left) * (top - bottom) * dotsPerM2;
  for (let i = 0; i < dots; i++) {
    context.fillStyle = draw() > 0.5 ? "#ffffff55" : "#5b5f8a16";
    context.fillRect(left + draw() * (right - left), bottom + draw() * (top - bottom), DOT_M, DOT_M);
  }
}

function drawTiles(context: Context, box: Box, color: string, pitch: number, draw: () => number): void {
  const [left, bottom, right, top] = box;
  fill(context, box, mix(color, "#6b7680", 0.14));
  for (let x = left; x < right; x += pitch) {
    for (let y = bottom; y < top; y += pitch) {
      context.fillStyle = mix(color, "#ffffff", draw() * 0.45);
      context.fillRect(x + JOINT_M, y + JOINT_M, pitch - 2 * JOINT_M, pitch - 2 * JOINT_M);
    }
  }
}
