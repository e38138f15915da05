/** Follow a running simulation: frames from the server become the tracks and lanes of a run. */

import { signal } from "@preact/signals";
import type { LiveFrame, RunFacts, SightingFacts, WallsFacts } from "../contract";
import { Beliefs } from "../data/beliefs";
import type { Observation } from "../data/observations";
import { AWAY } from "../data/rooms";
import { Run } from "../data/run";
import type { RunSource } from "../data/source";
import { Track } from "../data/tracks";
import * as state from "../state";

/** The newest state of the simulation. */
export const status = signal<LiveFrame | null>(null);
export const connected = signal(true);

async function json<T>(url: string): Promise<T> {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status}`);
  return (await response.json()) as T;
}

const NOTHING = "a run that is under way has no tables yet";

const source: RunSource = {
  facts: () => json<RunFacts>("live/facts.json"),
  sightings: () => Promise.resolve([]),
  walls: (number) => json<WallsFacts>(`live/walls/${number}.json`),
  table: () => Promise.reject(new Error(NOTHING)),
};

/** What robots have in view now; earlier moments are not kept. */
class LiveObservations {
  step = -1;
  seen: [string, string][] = [];

  constructor(private readonly run: Run) {}

  at(step: number): Observation[] {
    if (step !== this.step) return [];
    return this.seen.map(([robot, user]) => {
      const pose = this.run.tracks.get(user)?.poseAt(step * this.run.clock.stepUs);
      const x = pose ? this.run.home.metres(pose.x, 0) : NaN;
      const y = pose ? this.run.home.metres(pose.y, 1) : NaN;
      return { robot, user, x, y, room: "", trueUser: null, trueX: x, trueY: y };
    });
  }

  load(): Promise<void> {
    return Promise.resolve();
  }
}

export class Feed {
  private readonly observations: LiveObservations;
  private readonly shares = new Map<string, { us: number[]; shares: Float64Array[] }>();
  private lastStep = -1;

  private constructor(readonly run: Run) {
    this.observations = new LiveObservations(run);
    run.observations = this.observations;
    for (const body of run.bodies) {
      run.tracks.set(body.name, Track.none());
      run.rooms.set(body.name, { from: [], to: [], value: [] });
    }
  }

  static async open(): Promise<Feed> {
    return new Feed(new Run(await source.facts(), source));
  }

  follow(): void {
    const stream = new EventSource("live/frames");
    stream.onmessage = (event) => this.take(JSON.parse(event.data as string) as LiveFrame[]);
    stream.onopen = () => {
      connected.value = true;
    };
    stream.onerror = () => {
      connected.value = false;
    };
  }

  /** Take in frames, in order. */
  take(frames: readonly LiveFrame[]): void {
    const last = frames[frames.length - 1];
    if (!last) return;
    for (const frame of frames) this.add(frame);
    status.value = last;
    this.run.changed();
    if (state.follow.value) state.goTo(last.step * this.run.clock.stepUs);
  }

  private add(frame: LiveFrame): void {
    const us = frame.step * this.run.clock.stepUs;
    for (const event of frame.events) {
      const at = event.step * this.run.clock.stepUs;
      this.run.events.add(event.step, at, event.entity, event.event, event.user, event.detail);
    }
    this.run.facts.marks.push(...frame.marks);
    const { walls } = this.run.facts;
    if (walls[walls.length - 1]!.walls !== frame.walls) walls.push({ step: frame.step, walls: frame.walls });
    for (const body of frame.bodies) {
      const track = this.run.tracks.get(body.name);
      if (!track) continue;
      track.append(us, body);
      this.run.ahead.set(body.name, [body.x, body.y, ...body.ahead.flatMap(([, x, y]) => [x, y])]);
      this.run.behaviorNotes.set(body.name, body.note);
      this.addRoom(body.name, us, body.away ? AWAY : this.run.home.roomAt(body.x, body.y));
    }
    this.observations.step = frame.step;
    this.observations.seen = frame.seen;
    for (const [robot, user] of frame.seen) this.addSighting(robot, user, frame.step);
    for (const [name, shares] of Object.entries(frame.beliefs)) this.addBelief(name, us, shares);
    this.lastStep = frame.step;
  }

  private addRoom(name: string, us: number, room: number): void {
    const lane = this.run.rooms.get(name)!;
    const [from, to, value] = [lane.from as number[], lane.to as number[], lane.value as number[]];
    const n = from.length;
    if (n > 0) to[n - 1] = us;
    if (n > 0 && value[n - 1] === room) return;
    from.push(us);
    to.push(us + this.run.clock.stepUs);
    value.push(room);
  }

  private addSighting(robot: string, user: string, step: number): void {
    let lane: SightingFacts | undefined = this.run.sightings.find((entry) => entry.robot === robot && entry.user === user);
    if (!lane) {
      lane = { robot, user, first: [], last: [], false: [] };
      this.run.sightings.push(lane);
    }
    const n = lane.last.length;
    if (n > 0 && lane.last[n - 1]! >= this.lastStep) lane.last[n - 1] = step;
    else {
      lane.first.push(step);
      lane.last.push(step);
      lane.false.push(false);
    }
  }

  private addBelief(name: string, us: number, shares: readonly number[]): void {
    let series = this.shares.get(name);
    if (!series) {
      series = { us: [], shares: [] };
      this.shares.set(name, series);
      const user = this.run.bodies.find((body) => !body.robot)?.name ?? "";
      this.run.beliefs.push(new Beliefs(name, new Map([[user, series]]), this.run.isOfNow(name)));
    }
    const last = series.shares[series.shares.length - 1];
    if (last && shares.every((share, i) => share === last[i])) return;
    series.us.push(us);
    series.shares.push(Float64Array.from([...shares, 0]));
  }
}
