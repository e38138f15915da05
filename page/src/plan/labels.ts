/** Names of rooms: clear of furniture, walls and bodies, as near as possible to the middle of the room. */

import type { Home } from "../data/home";
import type { Frame } from "./frame";
import { LIFT_M } from "./ground";

type Context = CanvasRenderingContext2D;

/** A place for a name: its middle and size [px]. */
interface Spot {
  x: number;
  y: number;
  wide: number;
  tall: number;
  size: number;
  lines: readonly string[];
}

/** A circle that no name may cover [px]. */
export interface Disc {
  x: number;
  y: number;
  radius: number;
}

const FONT = "system-ui, sans-serif";
const LARGEST_PX = 13;
const SMALLEST_PX = 8.5;
const MOST_SPOTS = 6;
const TRIES = 24; // along each side of a room

export class Labels {
  private readonly spots: Spot[][];
  private readonly last: number[];

  constructor(
    context: Context,
    home: Home,
    frame: Frame,
    withFurniture: boolean,
  ) {
    const blocked = withFurniture ? home.facts.objects.map((thing) => boxOf(thing.outline, frame)) : [];
    for (const { start, end, leaf } of home.facts.doorways) if (leaf) blocked.push(swingOf(start, end, frame));
    this.spots = home.facts.rooms.map((_, room) => spotsOf(context, home, frame, room, blocked));
    this.last = home.facts.rooms.map(() => 0);
  }

  /** Choose for each name the first of its places that no body covers, if there is one; return their boxes. */
  place(bodies: readonly Disc[]): Box[] {
    const boxes: Box[] = [];
    this.spots.forEach((spots, room) => {
      const isFree = (spot: Spot): boolean => bodies.every((body) => !covers(body, spot));
      const at = this.last[room]!;
      const best = spots[at] && isFree(spots[at]) ? at : spots.findIndex(isFree);
      this.last[room] = best;
      const spot = spots[best];
      if (spot) boxes.push([spot.x - spot.wide / 2, spot.y - spot.tall / 2, spot.x + spot.wide / 2, spot.y + spot.tall / 2]);
    });
    return boxes;
  }

  /** What the places that were chosen last depend on. */
  get key(): string {
    return this.last.join();
  }

  /** Write the names at the places that were chosen last. */
  write(context: Context, color: (room: number) => string): void {
    context.textAlign = "center";
    context.textBaseline = "middle";
    this.spots.forEach((spots, room) => {
      const spot = spots[this.last[room]!];
      if (!spot) return;
      context.font = `600 ${spot.size}px ${FONT}`;
      context.fillStyle = color(room);
      spot.lines.forEach((line, i) => context.fillText(line, spot.x, spot.y + (i - (spot.lines.length - 1) / 2) * spot.size * 1.16));
    });
  }
}

function covers({ x, y, radius }: Disc, spot: Spot): boolean {
  return Math.abs(x - spot.x) < spot.wide / 2 + radius && Math.abs(y - spot.y) < spot.tall / 2 + radius;
}

export type Box = readonly [left: number, top: number, right: number, bottom: number];

function boxOf(outline: readonly (readonly [number, number])[], frame: Frame): Box {
  const [xs, ys] = [outline.map(([x]) => frame.x(x)), outline.map(([, y]) => frame.y(y))];
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

/** The floor over which an open door swings. */
function swingOf(start: readonly [number, number], end: readonly [number, number], frame: Frame): Box {
  const [dx, dy] = [end[0] - start[0], end[1] - start[1]];
  return boxOf([start, end, [start[0] - dy, start[1] + dx], [end[0] - dy, end[1] + dx]], frame);
}

export function overlap(one: Box, other: Box): boolean {
  return one[0] < other[2] && one[2] > other[0] && one[1] < other[3] && one[3] > other[1];
}

/** Places for the name of a room, in lines and sizes that fit, best first. */
function spotsOf(context: Context, home: Home, frame: Frame, room: number, blocked: readonly Box[]): Spot[] {
  const words = home.labels[room]!;
  const wrapped = words.includes(" ") ? [[words], words.split(/ (?=[^ ]*$)/)] : [[words]];
  for (let size = Math.min(LARGEST_PX, Math.max(10, 0.31 * frame.scale)); size >= SMALLEST_PX; size -= 1) {
    const found = wrapped.flatMap((lines) => placesOf(context, home, frame, room, blocked, lines, size));
    if (found.length > 0) return spread(found);
  }
  return [];
}

function placesOf(context: Context, home: Home, frame: Frame, room: number, blocked: readonly Box[], lines: readonly string[], size: number): [number, Spot][] {
  context.font = `600 ${size}px ${FONT}`;
  const wide = Math.max(...lines.map((line) => context.measureText(line).width)) + 8;
  const tall = size * 1.16 * lines.length + 4;
  const [left, bottom, right, top] = home.floors[room]!.box;
  const [ax, ay] = home.facts.rooms[room]!.anchor;
  const found: [number, Spot][] = [];
  for (let i = 0; i <= TRIES; i++) {
    for (let k = 0; k <= TRIES; k++) {
      const x = frame.x(left + ((right - left) * i) / TRIES);
      const y = frame.y(bottom + ((top - bottom) * k) / TRIES);
      const box: Box = [x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2];
      if (blocked.some((other) => overlap(box, other)) || !isInRoom(home, frame, room, box)) continue;
      const far = Math.hypot(x - frame.x(ax), y - frame.y(ay)) + (lines.length - 1) * 0.6 * frame.scale;
      found.push([far, { x, y, wide, tall, size, lines }]);
    }
  }
  return found;
}

/** Whether corners and sides of a box are in a room. */
function isInRoom(home: Home, frame: Frame, room: number, [left, top, right, bottom]: Box): boolean {
  const xs = [left, (left + right) / 2, right];
  // The wall in the south rises in front of the floor.
  const ys = [top, bottom + LIFT_M * frame.scale];
  return xs.every((px) =>
    ys.every((py) => {
      const [x, y] = frame.place(px, py);
      return home.roomAt(home.units(x, 0), home.units(y, 1)) === room;
    }),
  );
}

/** The best places that are some way apart from each other. */
function spread(found: [number, Spot][]): Spot[] {
  found.sort(([one], [other]) => one - other);
  const chosen: Spot[] = [];
  for (const [, spot] of found) {
    if (chosen.every((other) => Math.hypot(other.x - spot.x, other.y - spot.y) > 30)) chosen.push(spot);
    if (chosen.length === MOST_SPOTS) break;
  }
  return chosen;
}
