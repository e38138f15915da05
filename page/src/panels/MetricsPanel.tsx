/** Metrics over the run as charts, and their results. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { flat, numberColumns, readSeries, type Series, thinned } from "../data/metrics";
import type { Run } from "../data/run";
import * as state from "../state";
import { bodyColor, colors, PALETTE } from "../theme";

export function MetricsPanel() {
  const run = state.run.value!;
  const tables = run.facts.tables.filter((table) => table.role === "metric" && table.rows > 0);
  return (
    <div>
      {tables.flatMap((table) => numberColumns(table).map((column) => <Chart key={`${table.name}.${column}`} run={run} name={table.name} column={column} />))}
      <AnyColumn run={run} />
      <h2>Results at the end of the run</h2>
      <Results runs={state.runs.value} />
    </div>
  );
}

/** A plot of any column of any table. */
function AnyColumn({ run }: { run: Run }) {
  const tables = run.facts.tables.filter((table) => table.rows > 0 && table.role !== "layer");
  const [name = "", column = ""] = split(state.plot.value);
  const exists = tables.some((table) => table.name === name && numberColumns(table).includes(column));
  return (
    <>
      <label>
        Plot{" "}
        <select
          aria-label="Column to plot"
          value={exists ? state.plot.value : ""}
          onChange={(event) => {
            state.plot.value = event.currentTarget.value;
          }}
        >
          <option value="">a column of a table …</option>
          {tables.map((table) => (
            <optgroup key={table.name} label={table.name}>
              {numberColumns(table).map((entry) => (
                <option key={entry} value={`${table.name}.${entry}`}>
                  {table.name}.{entry}
                </option>
              ))}
            </optgroup>
          ))}
        </select>
      </label>
      {exists && <Chart key={state.plot.value} run={run} name={name} column={column} />}
    </>
  );
}

/** Table and column of "table.column": names of tables may have dots, those of columns have none. */
function split(plot: string): [string, string] {
  const dot = plot.lastIndexOf(".");
  return [plot.slice(0, Math.max(0, dot)), plot.slice(dot + 1)];
}

function Chart({ run, name, column }: { run: Run; name: string; column: string }) {
  const box = useRef<HTMLDivElement>(null);
  const runs = state.runs.value;
  const lines = useSignal<Series[]>([]);
  const unit = run.tableFacts(name)?.columns.find((entry) => entry.name === column)?.unit ?? "";
  useEffect(() => {
    void run.attempt(async () => {
      const ofRuns = await Promise.all(runs.map((entry) => linesOf(entry, name, column, runs.length > 1 ? entry.facts.title : "")));
      lines.value = ofRuns.flat();
    });
  }, [runs, name, column]);
  useEffect(() => {
    if (lines.value.length === 0 || !box.current) return undefined;
    const chart = drawChart(box.current, run, lines.value);
    return () => chart.destroy();
  }, [lines.value, colors.value]);
  return (
    <figure class="chart">
      <figcaption>{`${name}: ${column}${unit ? ` [${unit}]` : ""}`.replaceAll("_", " ")}</figcaption>
      <div ref={box} role="img" aria-label={`${column} of ${name} over the run`} />
    </figure>
  );
}

/** The lines of a column of a run; those of several runs have the names of their runs. */
async function linesOf(run: Run, name: string, column: string, title: string): Promise<Series[]> {
  const facts = run.tableFacts(name);
  const table = await run.open(name);
  if (!facts || !table || !numberColumns(facts).includes(column)) return [];
  const series = (await readSeries(facts, table, run.clock.stepUs, column)).map(thinned);
  return title ? series.map((line) => ({ ...line, name: [line.name, title].filter(Boolean).join(" · ") })) : series;
}

function drawChart(box: HTMLElement, run: Run, lines: readonly Series[]): uPlot {
  const moments = [...new Set(lines.flatMap((line) => line.us))].sort((a, b) => a - b);
  const index = new Map(moments.map((us, i) => [us, i]));
  const data: uPlot.AlignedData = [
    moments.map((us) => (run.clock.startMs + us / 1000) / 1000),
    ...lines.map((line) => {
      const values: (number | null)[] = moments.map(() => null);
      line.us.forEach((us, i) => {
        const value = line.values[i]!;
        values[index.get(us)!] = Number.isNaN(value) ? null : value;
      });
      return values;
    }),
  ];
  const us = (seconds: number): number => (seconds * 1000 - run.clock.startMs) * 1000;
  const dates = (_: uPlot, splits: number[]): string[] =>
    splits.map((at) => (run.clock.timeText(us(at)) === "00:00:00" ? run.clock.dateText(us(at)).slice(4) : run.clock.timeText(us(at), false)));
  const axis: uPlot.Axis = { stroke: colors.value.text, grid: { stroke: colors.value.line }, ticks: { stroke: colors.value.line } };
  const options: uPlot.Options = {
    width: Math.max(200, box.clientWidth),
    height: 150,
    tzDate: (seconds) => new Date(seconds * 1000 + new Date(seconds * 1000).getTimezoneOffset() * 60_000),
    legend: { show: true, live: false },
    cursor: { drag: { x: false, y: false } },
    axes: [{ ...axis, values: dates }, { ...axis, size: 44 }],
    series: [
      {},
      ...lines.map((line, i) => ({
        label: line.name.replaceAll("_", " "),
        stroke: bodyColor(PALETTE[i % PALETTE.length]!),
        width: 1.5,
        // With more lines than colours, the others are dashed: none looks like another.
        ...(i >= PALETTE.length && { dash: [6, 4] }),
        spanGaps: true,
        points: { show: moments.length < 40, size: 4 },
      })),
    ],
  };
  const chart = new uPlot(options, data, box);
  chart.over.addEventListener("click", () => {
    const seconds = chart.posToVal(chart.cursor.left ?? 0, "x");
    state.goTo(us(seconds));
  });
  return chart;
}

function Results({ runs }: { runs: readonly Run[] }) {
  const names = [...new Set(runs.flatMap((run) => flat(run.facts.metrics).map(([name]) => name)))];
  const values = runs.map((run) => new Map(flat(run.facts.metrics)));
  return (
    <table class="results">
      <thead>
        <tr>
          <th scope="col">metric</th>
          {runs.map((run, i) => (
            <th key={i} scope="col">
              {runs.length > 1 ? run.facts.title : "value"}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {names.map((name) => (
          <tr key={name} class={differs(values.map((ofRun) => ofRun.get(name))) ? "differs" : ""}>
            <th scope="row">{name}</th>
            {values.map((ofRun, i) => (
              <td key={i} class="number">
                {ofRun.get(name) ?? "–"}
              </td>
            ))}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function differs(values: readonly unknown[]): boolean {
  return values.some((value) => value !== values[0]);
}
