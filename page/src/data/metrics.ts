/** Metrics and other tables of numbers over time. */

import type { TableFacts } from "../contract";
import type { Table } from "./parquet";

export interface Series {
  name: string;
  us: number[];
  values: number[];
}

const MOST_SERIES = 12;
/** A line of more values is drawn with every second, third … of them. */
const MOST_VALUES = 4000;

/** The columns of a table that can be drawn over time. */
export function numberColumns(facts: TableFacts): string[] {
  const numbers = facts.columns.filter((column) => ["float64", "int64", "int32", "bool"].includes(column.kind));
  return numbers.map((column) => column.name).filter((name) => name !== "step" && name !== "time");
}

/** A line with at most so many values that they can be told apart. */
export function thinned(line: Series): Series {
  const every = Math.ceil(line.us.length / MOST_VALUES);
  if (every <= 1) return line;
  return { ...line, us: line.us.filter((_, i) => i % every === 0), values: line.values.filter((_, i) => i % every === 0) };
}

/**
 * Read a table as lines over time: one per number column and word, such as user or room; or those of one column, named
 * by their words alone.
 */
export async function readSeries(facts: TableFacts, table: Table, stepUs: number, column?: string): Promise<Series[]> {
  const numbers = column ? [column] : numberColumns(facts);
  const words = facts.columns.filter((column) => column.kind === "category");
  const steps = await table.numbers("step");
  const labels = await Promise.all(words.map((column) => table.words(column.name)));
  const keys: string[] = [];
  for (let i = 0; i < steps.length; i++) {
    keys.push(labels.map((label) => label.words[label.codes[i]!] ?? "").join(" · "));
  }
  const series = new Map<string, Series>();
  for (const name of numbers) {
    const values = await table.numbers(name);
    for (let i = 0; i < steps.length; i++) {
      const label = [keys[i], numbers.length > 1 || !keys[i] ? name : ""].filter(Boolean).join(" · ");
      let line = series.get(label);
      if (!line) {
        if (series.size >= MOST_SERIES) continue;
        line = { name: label, us: [], values: [] };
        series.set(label, line);
      }
      line.us.push(steps[i]! * stepUs);
      line.values.push(values[i]!);
    }
  }
  return [...series.values()];
}

const MOST_LETTERS = 60;

/** A result in words: numbers in four digits, and what is missing or no number as that. */
function resultText(value: unknown): string {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toPrecision(4);
  const text = String(value);
  return text.length > MOST_LETTERS ? `${text.slice(0, MOST_LETTERS - 1)}…` : text;
}

/** The results of metrics one by one: their names, with those of what they are parts of, and their values in words. */
export function flat(value: unknown, name = ""): [string, string][] {
  if (typeof value !== "object" || value === null) return [[name, resultText(value)]];
  const parts = Object.entries(value);
  if (parts.length === 0) return name ? [[name, "empty"]] : [];
  return parts.flatMap(([key, part]) => flat(part, name ? `${name} · ${key}` : key));
}
