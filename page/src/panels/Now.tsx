/** Everybody at the moment: room, place, activity, who is seen. */

import type { BodyFacts } from "../contract";
import { iconOf } from "../data/activities";
import { durationText } from "../data/clock";
import { isFalse } from "../data/observations";
import { AWAY, roomOf } from "../data/rooms";
import type { Run } from "../data/run";
import { lastAtMost } from "../data/search";
import { TURN } from "../data/tracks";
import { doing, title } from "../data/words";
import { Icon } from "../Icon";
import { playReel } from "../player";
import * as state from "../state";
import { pillColor } from "../theme";
import { Thumbnail } from "../timeline/Hover";
import { Differences } from "./Differences";
import { Tiles } from "./Tiles";

export interface BodyState {
  name: string;
  room: string;
  x: number;
  y: number;
  headingDeg: number;
  away: boolean;
  activity: string;
  sees: string[];
}

export function bodyState(run: Run, name: string, us: number): BodyState | null {
  const track = run.tracks.get(name);
  if (!track || track.empty) return null;
  const pose = track.poseAt(us);
  const room = roomOf(track, run.home, us);
  const sightings = run.observations?.at(run.clock.stepAt(us)) ?? [];
  return {
    name,
    room: room === AWAY ? "away" : run.home.roomName(room),
    x: run.home.metres(pose.x, 0),
    y: run.home.metres(pose.y, 1),
    headingDeg: (pose.heading * 360) / TURN,
    away: pose.away,
    activity: run.events.last(name, "activity", us)?.detail ?? "",
    sees: sightings.filter((row) => row.robot === name).map((row) => `${row.user ? run.label(row.user) : "somebody"}${isFalse(row) ? " (false)" : ""}`),
  };
}

export function Now() {
  return (
    <>
      <Differences />
      {state.runs.value.map((run, i) => (
        <NowOf key={i} run={run} title={state.runs.value.length > 1 ? run.facts.title : ""} />
      ))}
    </>
  );
}

function NowOf({ run, title: heading }: { run: Run; title: string }) {
  void run.version.value;
  const us = state.told.value;
  const step = run.clock.stepAt(us);
  return (
    <>
      <table class="now" data-step={step}>
        <caption>
          {heading ? `${heading}: ` : ""}step {step}
        </caption>
        <thead class="visually-hidden">
          <tr>
            <th scope="col">Who</th>
            <th scope="col">Does</th>
            <th scope="col">In view</th>
          </tr>
        </thead>
        <tbody>
          {run.bodies.map((body) => (
            <BodyRow key={body.name} run={run} body={body} us={us} />
          ))}
        </tbody>
      </table>
      {run.bodies.length === 0 && <p class="hint">Nobody is in this home, neither people nor robots: a scenario names them under users and robots.</p>}
      <Expectations run={run} />
      <Tiles run={run} />
      <Story run={run} />
    </>
  );
}

function BodyRow({ run, body, us }: { run: Run; body: BodyFacts; us: number }) {
  void run.version.value;
  const now = bodyState(run, body.name, us);
  const index = now ? run.home.roomIndex(now.room) : -1;
  const place = now?.away ? "out of home" : (run.home.labels[index] ?? now?.room ?? "not stored");
  const what = [now?.activity && !now.away ? doing(now.activity) : "", title(place)].filter(Boolean).join(" · ");
  return (
    <tr data-body={body.name} data-x={now?.x} data-y={now?.y} data-heading={now?.headingDeg} data-room={now?.room} data-away={now?.away}>
      <th scope="row">
        <button type="button" class="link" onClick={() => state.select(body.name, run)}>
          <span class={body.robot ? "avatar robot" : "avatar"} style={{ background: pillColor(body.color) }}>
            <Icon name={body.robot ? "robot" : now?.away ? "bag" : iconOf(now?.activity ?? "")} size={17} />
          </span>
          {run.label(body.name)}
        </button>
      </th>
      <td title={now && !now.away ? `${now.x.toFixed(2)} m, ${now.y.toFixed(2)} m` : ""}>
        {what}
        {now && now.sees.length > 0 && <small> sees {now.sees.join(", ")}</small>}
      </td>
      <td class="number seen-ago">
        {!body.robot && run.storesSightings && run.sightings.length > 0 && (
          <>
            <Icon name="eye" size={13} /> {seenAgo(run, body.name, us)}
          </>
        )}
      </td>
    </tr>
  );
}

/** How long ago a robot noticed somebody last. */
function seenAgo(run: Run, name: string, us: number): string {
  const { from, to } = run.seen(name);
  const i = lastAtMost(from, us);
  if (i < 0) return "never";
  return us < to[i]! ? "now" : durationText(us - to[i]!).replace(/ \d+ s$/, "");
}

function Expectations({ run }: { run: Run }) {
  const { verdicts } = run.facts;
  if (verdicts.length === 0) return null;
  return (
    <section class="expectations">
      <h2>Expectations</h2>
      <ul>
        {verdicts.map(({ name, outcome, says, step }) => (
          <li key={name} class={outcome === "violated" ? "is-violated" : outcome === "held" ? "is-held" : ""} title={says}>
            <Icon name={outcome === "violated" ? "cross" : "check"} size={13} />
            {step === null ? (
              <span>{title(name)}</span>
            ) : (
              <button type="button" class="link" onClick={() => state.goTo(step * run.clock.stepUs)}>
                {title(name)}
                <small>{says}</small>
              </button>
            )}
            <small>{outcome}</small>
          </li>
        ))}
      </ul>
    </section>
  );
}

/** Moments that are worth a look, as cards with the home at each; all of them as a reel. */
function Story({ run }: { run: Run }) {
  const { story } = run.facts;
  if (story.length === 0) return null;
  return (
    <section class="story">
      <h2>
        Story
        {run === state.run.value && (
          <button type="button" title="All moments in half a minute (r)" onClick={playReel}>
            <Icon name="play" size={11} /> Play all
          </button>
        )}
      </h2>
      <ol>
        {story.map(({ step, title: words, words: about, who }) => (
          <li key={words}>
            <button type="button" class="card" onClick={() => state.goTo(step * run.clock.stepUs)}>
              <Thumbnail run={run} us={step * run.clock.stepUs} focus={who[0] ?? ""} />
              <b>{words}</b>
              <span>{about}</span>
              <time>{run.clock.text(step * run.clock.stepUs).slice(0, -3)}</time>
            </button>
          </li>
        ))}
      </ol>
    </section>
  );
}
