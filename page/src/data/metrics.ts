/** Metrics and other tables of numbers over time. */

import type { TableFacts } from "../contract";
import type { Table } from "./parquet";

export interface Series {
  name: string;
  us: number[];
  values: number[];
}

const MOST_SERIES = 12;

/** Read a table as lines over time: one per number column and word, such as user or room. */
export async function readSeries(facts: TableFacts, table: Table, stepUs: number): Promise<Series[]> {
  const numbers = facts.columns.filter((column) => ["float64", "int64", "int32"].includes(column.kind));
  const words = facts.columns.filter((column) => column.kind === "category");
  const steps = await table.numbers("step");
  const labels = await Promise.all(words.map((column) => table.words(column.name)));
  const keys: string[] = [];
  for (let i = 0; i < steps.length; i++) {
    keys.push(labels.map((label) => label.words[label.codes[i]!] ?? "").join(" · "));
  }
  const series = new Map<string, Series>();
  for (const column of numbers) {
    const values = await table.numbers(column.name);
    for (let i = 0; i < steps.length; i++) {
      const name = [keys[i], numbers.length > 1 || !keys[i] ? column.name : ""].filter(Boolean).join(" · ");
      let line = series.get(name);
      if (!line) {
        if (series.size >= MOST_SERIES) continue;
        line = { name, us: [], values: [] };
        series.set(name, line);
      }
      line.us.push(steps[i]! * stepUs);
      line.values.push(values[i]!);
    }
  }
  return [...series.values()];
}
