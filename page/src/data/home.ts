/** The home: from lattice units to metres, and the room of each place. */

import type { HomeFacts } from "../contract";

export const UNITS_PER_CELL = 64;

export class Home {
  /** Room of each cell, row by row from the lowest; -1 is none. */
  readonly cells: Int16Array;
  /** The same for places: a cell that a wall cuts has the room of the part that is free. */
  private readonly places: Int16Array;

  constructor(readonly facts: HomeFacts) {
    const size = facts.columns * facts.rows;
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
