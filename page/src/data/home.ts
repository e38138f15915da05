/** The home: from lattice units to metres, and the room of each place. */

import type { HomeFacts, UseFacts } from "../contract";
import { roomLabels } from "./words";

export const UNITS_PER_CELL = 64;

/** The cells of a room, grown by two into what isn't free so that they reach slanted walls, and their box [m]. */
export interface Floor {
  path: Path2D;
  box: [left: number, bottom: number, right: number, top: number];
}

export class Home {
  /** Room of each cell, row by row from the lowest; -1 is none. */
  readonly cells: Int16Array;
  /** The same for places: a cell that a wall cuts has the room of the part that is free. */
  private readonly places: Int16Array;

  /** The names of rooms as people write them. */
  readonly labels: readonly string[];
  /** Floors of rooms, made when they are drawn first. */
  private made: readonly Floor[] | null = null;

  /** Where people sit or lie. */
  readonly restPlaces: readonly UseFacts[];

  constructor(readonly facts: HomeFacts) {
    const size = facts.columns * facts.rows;
    this.labels = roomLabels(facts.rooms);
    this.restPlaces = facts.objects.flatMap((thing) => thing.uses.filter((use) => use.posture !== "stand"));
    this.cells = unpacked(facts.room_cells, size);
    this.places = unpacked(facts.place_cells, size);
  }

  metres(units: number, axis: 0 | 1): number {
    return (units + this.facts.origin_units[axis]) / this.facts.units_per_m;
  }

  units(metres: number, axis: 0 | 1): number {
    return Math.round(metres * this.facts.units_per_m) - this.facts.origin_units[axis];
  }

  /** Index of the room at a place [lattice]; -1 where there is none. */
  roomAt(x: number, y: number): number {
    const column = Math.floor(x / UNITS_PER_CELL);
    const row = Math.floor(y / UNITS_PER_CELL);
    const { columns, rows } = this.facts;
    if (column < 0 || row < 0 || column >= columns || row >= rows) return -1;
    return this.places[row * columns + column]!;
  }

  roomName(index: number): string {
    return this.facts.rooms[index]?.name ?? "away";
  }

  /** A room as people write it. */
  roomLabel(index: number): string {
    return this.labels[index] ?? "away";
  }

  get floors(): readonly Floor[] {
    this.made ??= floorsOf(this);
    return this.made;
  }

  roomIndex(name: string): number {
    return this.facts.rooms.findIndex((room) => room.name === name);
  }
}

function unpacked(runs: readonly number[], size: number): Int16Array {
  const values = new Int16Array(size);
  let at = 0;
  for (let i = 0; i < runs.length; i += 2) {
    values.fill(runs[i]!, at, at + runs[i + 1]!);
    at += runs[i + 1]!;
  }
  return values;
}

function floorsOf(home: Home): Floor[] {
  const { columns, rows, cell, rooms, origin_units: origin, units_per_m: units } = home.facts;
  const [left, bottom] = [origin[0] / units, origin[1] / units];
  const floors = rooms.map((): Floor => ({ path: new Path2D(), box: [Infinity, Infinity, -Infinity, -Infinity] }));
  const cells = grown(home.cells, columns);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; ) {
      const room = cells[row * columns + column]!;
      let end = column + 1;
      while (end < columns && cells[row * columns + end] === room) end++;
      const floor = floors[room];
      if (floor) {
        const [x, y, far] = [left + column * cell, bottom + row * cell, left + end * cell];
        floor.path.rect(x, y, far - x, cell);
        const { box } = floor;
        floor.box = [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], far), Math.max(box[3], y + cell)];
      }
      column = end;
    }
  }
  return floors;
}

/** Cells of rooms grown by two into those of none. */
function grown(cells: Int16Array, columns: number): Int16Array {
  let last = cells;
  for (let round = 0; round < 2; round++) {
    const next = Int16Array.from(last);
    last.forEach((room, i) => {
      if (room >= 0) return;
      next[i] = Math.max(last[i - 1] ?? -1, last[i + 1] ?? -1, last[i - columns] ?? -1, last[i + columns] ?? -1);
    });
    last = next;
  }
  return last;
}
