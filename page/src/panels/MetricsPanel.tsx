/** Metrics over the run as charts, and their results. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { type Series, readSeries } from "../data/metrics";
import type { Run } from "../data/run";
import * as state from "../state";
import { bodyColor, colors } from "../theme";

const PALETTE = ["#0077bb", "#ee7733", "#009988", "#aa3377", "#cc3311", "#33bbee", "#777777"];

export function MetricsPanel() {
  const run = state.run.value!;
  const tables = run.facts.tables.filter((table) => table.role === "metric" && table.rows > 0);
  return (
    <div>
      {tables.map((table) => (
        <Chart key={table.name} run={run} name={table.name} />
      ))}
      <h3>Results</h3>
      <Results runs={state.runs.value} />
    </div>
  );
}

function Chart({ run, name }: { run: Run; name: string }) {
  const box = useRef<HTMLDivElement>(null);
  const lines = useSignal<Series[]>([]);
  useEffect(() => {
    void run.attempt(async () => {
      const table = await run.open(name);
      if (table) lines.value = await readSeries(run.tableFacts(name)!, table, run.clock.stepUs);
    });
  }, [run, name]);
  useEffect(() => {
    if (lines.value.length === 0 || !box.current) return undefined;
    const chart = drawChart(box.current, run, lines.value);
    return () => chart.destroy();
  }, [lines.value, colors.value]);
  return (
    <figure class="chart">
      <figcaption>{name.replaceAll("_", " ")}</figcaption>
      <div ref={box} role="img" aria-label={`${name} over the run`} />
    </figure>
  );
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
  const axis: uPlot.Axis = { stroke: colors.value.text, grid: { stroke: colors.value.line }, ticks: { stroke: colors.value.line } };
  const options: uPlot.Options = {
    width: Math.max(200, box.clientWidth),
    height: 150,
    tzDate: (seconds) => new Date(seconds * 1000 + new Date(seconds * 1000).getTimezoneOffset() * 60_000),
    legend: { show: true, live: false },
    cursor: { drag: { x: false, y: false } },
    axes: [axis, { ...axis, size: 44 }],
    series: [
      {},
      ...lines.map((line, i) => ({
        label: line.name.replaceAll("_", " "),
        stroke: bodyColor(PALETTE[i % PALETTE.length]!),
        width: 1.5,
        spanGaps: true,
        points: { show: moments.length < 40, size: 4 },
      })),
    ],
  };
  const chart = new uPlot(options, data, box);
  chart.over.addEventListener("click", () => {
    const seconds = chart.posToVal(chart.cursor.left ?? 0, "x");
    state.goTo((seconds * 1000 - run.clock.startMs) * 1000);
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
                {asText(ofRun.get(name))}
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

function asText(value: unknown): string {
  if (typeof value !== "number") return value === undefined || value === null ? "–" : String(value);
  return Number.isInteger(value) ? String(value) : value.toPrecision(4);
}

function flat(value: unknown, name = ""): [string, unknown][] {
  if (typeof value !== "object" || value === null) return [[name, value]];
  return Object.entries(value).flatMap(([key, part]) => flat(part, name ? `${name} · ${key}` : key));
}
