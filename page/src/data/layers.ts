/** Layers of cells as a run stored them. */

import type { Home } from "./home";
import type { Table } from "./parquet";
import { lastAtMost } from "./search";

export interface Layer {
  step: number;
  /** By cell, row by row from the lowest; NaN where there is no value. */
  values: Float64Array;
  low: number;
  high: number;
}

/** A layer after each step at which it was stored. */
export class LayerTable {
  private constructor(
    private readonly table: Table,
    private readonly steps: number[],
    private readonly starts: number[],
    private readonly home: Home,
  ) {}

  static async open(table: Table, home: Home): Promise<LayerTable> {
    const step = await table.numbers("step");
    const row = await table.numbers("row");
    const steps: number[] = [];
    const starts: number[] = [];
    row.forEach((value, i) => {
      if (value === -1) {
        steps.push(step[i]!);
        starts.push(i);
      }
    });
    starts.push(row.length);
    return new LayerTable(table, steps, starts, home);
  }

  /** The layer as it was stored last up to a step, or first where that is later. */
  async at(step: number): Promise<Layer | null> {
    if (this.steps.length === 0) return null;
    const i = Math.max(0, lastAtMost(this.steps, step));
    const [from, to] = [this.starts[i]!, this.starts[i + 1]!];
    const row = await this.table.numbers("row", from, to);
    const column = await this.table.numbers("column", from, to);
    const value = await this.table.numbers("value", from, to);
    const { columns, rows } = this.home.facts;
    const values = new Float64Array(columns * rows).fill(value[0]!);
    for (let k = 1; k < row.length; k++) values[row[k]! * columns + column[k]!] = value[k]!;
    let low = Infinity;
    let high = -Infinity;
    values.forEach((cell, at) => {
      if (this.home.cells[at]! < 0 || Number.isNaN(cell)) return;
      low = Math.min(low, cell);
      high = Math.max(high, cell);
    });
    return { step: this.steps[i]!, values, low, high };
  }
}
