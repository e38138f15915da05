/** Below the plan: back, play, on; the days; the speed. Above it: the clock. */

import { computed, effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { DAY_US } from "./data/clock";
import { paceOf } from "./data/pace";
import type { Run } from "./data/run";
import { Icon } from "./Icon";
import { LiveControls } from "./live/LiveControls";
import { branchHere, branching, refusal } from "./live/orders";
import { fitted, oncePerFrame, sizeOf, watchSizes } from "./plan/canvas";
import * as state from "./state";
import { colors } from "./theme";

const CELLS_A_DAY = 48;

export function Clock() {
  const { clock } = state.run.value!;
  const us = state.told.value;
  const days = clock.day(Math.max(0, state.endUs.value - 1));
  return (
    <output class="clock" aria-label="Shown moment">
      <span class="time">
        <b>{clock.timeText(us, false)}</b>
        <small>{clock.timeText(us).slice(5)}</small>
      </span>
      <span class="date">
        {clock.dateText(us)} · day {clock.day(us)} of {days}
      </span>
    </output>
  );
}

export function Transport() {
  const run = state.run.value!;
  const playing = state.playing.value;
  const isLive = state.live.value;
  return (
    <section class="controls" aria-label="Time">
      {isLive ? (
        <LiveControls />
      ) : (
        <>
          <button type="button" class="round" aria-label={state.answer.value ? "Previous answer" : "Previous event"} onClick={() => state.jump(false)}>
            <Icon name="back" />
          </button>
          <button
            type="button"
            class="play"
            aria-label={playing ? "Pause" : "Play"}
            aria-pressed={playing}
            onClick={() => {
              state.playing.value = !playing;
            }}
          >
            <Icon name={playing ? "pause" : "play"} size={20} />
          </button>
          <button type="button" class="round" aria-label={state.answer.value ? "Next answer" : "Next event"} onClick={() => state.jump(true)}>
            <Icon name="on" />
          </button>
        </>
      )}
      <Overview run={run} />
      {!isLive && <SpeedChoice />}
      {run.path && state.runs.value.length === 1 && (
        <button
          type="button"
          class="primary"
          disabled={branching.value}
          title="A second future from this moment, beside this one"
          onClick={() => void branchHere(run)}
        >
          <Icon name="branch" /> {branching.value ? "Repeating the run …" : "Continue from here"}
        </button>
      )}
      {refusal.value && (
        <strong role="alert" class="status">
          {refusal.value}
        </strong>
      )}
    </section>
  );
}

function speedText(factor: number): string {
  if (factor === state.ADAPTIVE) return "Auto";
  return factor >= 86_400 ? "a day a second" : factor >= 3600 ? `${factor / 3600} h a second` : `${factor} ×`;
}

function SpeedChoice() {
  const all = [state.ADAPTIVE, ...state.SPEEDS];
  const choices = all.includes(state.speed.value) ? all : [...all, state.speed.value];
  return (
    <select
      aria-label="Speed"
      title="Auto: dull time flies, and what happens is watched at ease"
      value={String(state.speed.value)}
      onChange={(event) => {
        state.speed.value = Number(event.currentTarget.value);
      }}
    >
      {choices.map((factor) => (
        <option key={factor} value={String(factor)}>
          {speedText(factor)}
        </option>
      ))}
    </select>
  );
}

/** The whole run on one line: how much people move, its story and violations; a click goes there. */
function Overview({ run }: { run: Run }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const cursor = useRef<HTMLSpanElement>(null);
  const { clock } = run;
  useEffect(() => {
    const [drawn, line] = [canvas.current!, cursor.current!];
    const paint = oncePerFrame(() => {
      const { context, width, height } = fitted(drawn);
      context.clearRect(0, 0, width, height);
      drawOverview(context, run, width, height);
    });
    const move = (): void => {
      const [begin, end] = [state.beginUs.value, state.endUs.value];
      const share = (state.moment.value - begin) / (end - begin);
      line.style.transform = `translateX(${(share * sizeOf(drawn)[0] - 1).toFixed(1)}px)`;
    };
    const today = computed(() => clock.day(state.moment.value));
    const stops = [
      effect(() => {
        void [today.value, run.version.value, colors.value, state.endUs.value];
        paint();
      }),
      effect(move),
      watchSizes([drawn], () => {
        paint();
        move();
      }),
    ];
    return () => stops.forEach((stop) => stop());
  }, [run]);
  const seek = (event: PointerEvent): void => {
    if (event.type === "pointermove" && event.buttons !== 1) return;
    state.goTo(momentAt(event), event.type === "pointermove");
  };
  const momentAt = (event: PointerEvent): number => {
    const { left, width } = canvas.current!.getBoundingClientRect();
    return state.beginUs.value + ((event.clientX - left) / width) * (state.endUs.value - state.beginUs.value);
  };
  return (
    <div class="overview" {...momentSlider("Moment in the run")} onPointerDown={seek} onPointerMove={seek}>
      <canvas ref={canvas} aria-hidden="true" />
      <span ref={cursor} class="cursor" aria-hidden="true" />
    </div>
  );
}

/** What tells a reader of the screen that a part of the page is a slider of the moment. */
export function momentSlider(label: string) {
  const { clock } = state.run.value!;
  const us = state.told.value;
  return {
    role: "slider",
    tabIndex: 0,
    "aria-label": label,
    "aria-valuemin": 0,
    "aria-valuemax": clock.steps - 1,
    "aria-valuenow": clock.stepAt(us),
    "aria-valuetext": clock.text(us),
  } as const;
}

function drawOverview(context: CanvasRenderingContext2D, run: Run, width: number, height: number): void {
  const [begin, end] = [state.beginUs.value, state.endUs.value];
  const x = (us: number): number => ((us - begin) / (end - begin)) * width;
  const { clock } = run;
  const [first, last] = [clock.day(begin), clock.day(Math.max(begin, end - 1))];
  const today = clock.day(state.moment.value);
  const cell = Math.max(DAY_US / CELLS_A_DAY, (end - begin) / (width / 2));
  for (let day = first; day <= last; day++) {
    const [left, right] = [x(Math.max(begin, clock.dayStart(day))), x(Math.min(end, clock.dayStart(day + 1)))];
    context.fillStyle = colors.value.panel;
    context.fillRect(left, 0, Math.max(1, right - left - 1), height);
  }
  context.fillStyle = colors.value.bars;
  const shares = run.isRead.value ? paceOf(run).shares(begin, end, cell) : [];
  const most = Math.max(0.05, ...shares);
  shares.forEach((share, i) => {
    const us = begin + i * cell;
    const tall = (share / most) * (height - 8);
    context.fillRect(x(us), height - tall - 1, Math.max(1, x(us + cell) - x(us) - 0.7), tall);
  });
  const dot = (step: number, color: string): void => {
    context.beginPath();
    context.arc(x(step * clock.stepUs), 4, 3, 0, 2 * Math.PI);
    context.fillStyle = color;
    context.fill();
  };
  for (const { step } of run.facts.story) dot(step, colors.value.viewEdge);
  for (const { step } of run.facts.verdicts) if (step !== null) dot(step, colors.value.alarm);
  const [left, right] = [x(Math.max(begin, clock.dayStart(today))), x(Math.min(end, clock.dayStart(today + 1)))];
  context.strokeStyle = colors.value.text;
  context.lineWidth = 1.5;
  context.strokeRect(left + 0.75, 0.75, Math.max(2, right - left - 1.5), height - 1.5);
}
