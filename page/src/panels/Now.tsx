/** Everybody at the moment: room, place, activity, who is seen. */

import { isFalse } from "../data/observations";
import { AWAY, roomOf } from "../data/rooms";
import type { Run } from "../data/run";
import { TURN } from "../data/tracks";
import * as state from "../state";
import { bodyColor } from "../theme";

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
    sees: sightings.filter((row) => row.robot === name).map((row) => `${row.user || "somebody"}${isFalse(row) ? " (false)" : ""}`),
  };
}

export function Now() {
  return (
    <>
      {state.runs.value.map((run, i) => (
        <NowOf key={i} run={run} title={state.runs.value.length > 1 ? run.facts.title : ""} />
      ))}
    </>
  );
}

function NowOf({ run, title }: { run: Run; title: string }) {
  void run.version.value;
  const us = state.moment.value;
  const step = run.clock.stepAt(us);
  return (
    <table class="now" data-step={step}>
      <caption>{title ? `${title}: ` : ""}step {step}</caption>
      <thead>
        <tr>
          <th scope="col">Who</th>
          <th scope="col">Room</th>
          <th scope="col">Place [m]</th>
          <th scope="col">Does, sees</th>
        </tr>
      </thead>
      <tbody>
        {run.bodies.map((body) => {
          const now = bodyState(run, body.name, us);
          return (
            <tr
              key={body.name}
              data-body={body.name}
              data-x={now?.x}
              data-y={now?.y}
              data-heading={now?.headingDeg}
              data-room={now?.room}
              data-away={now?.away}
            >
              <th scope="row">
                <button type="button" class="link" onClick={() => state.select(body.name)}>
                  <span class={body.robot ? "chip robot" : "chip"} style={{ background: bodyColor(body.color) }} />
                  {body.name}
                </button>
              </th>
              <td>{now ? now.room.replaceAll("_", " ") : "not stored"}</td>
              <td class="number">{now && !now.away ? `${now.x.toFixed(2)}, ${now.y.toFixed(2)}` : "–"}</td>
              <td>{[now?.activity, now?.sees.length ? `sees ${now.sees.join(", ")}` : ""].filter(Boolean).join(", ")}</td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
