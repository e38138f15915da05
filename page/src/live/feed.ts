/** Follow running simulations: frames from the server become the tracks and lanes of runs. */

import { batch, computed, signal } from "@preact/signals";
import type { LiveFrame, LiveSession, RunFacts, SightingFacts, WallsFacts } from "../contract";
import { Beliefs } from "../data/beliefs";
import { Decisions } from "../data/decisions";
import type { Observation, ObservationSource } from "../data/observations";
import { AWAY } from "../data/rooms";
import { Run } from "../data/run";
import { json, type RunSource, ServedRun, TablesOnly } from "../data/source";
import { stretchesUntil } from "../data/stretches";
import { Track } from "../data/tracks";
import * as state from "../state";

/** The simulations that are under way and shown. */
export const feeds = signal<readonly Feed[]>([]);
/** The newest state of the last of them. */
export const status = computed<LiveFrame | null>(() => feeds.value[feeds.value.length - 1]?.status.value ?? null);
export const connected = signal(true);

const NOTHING = "a run that is under way has no tables yet";
/** Numbers of the walls that a branch shares with its past begin here. */
const PAST_WALLS = 1_000_000;

class LiveSource extends TablesOnly implements RunSource {
  protected readonly whyNoNotes = "notes are stored beside a run that is over";

  constructor(
    readonly path: string,
    private readonly past: Run | null,
  ) {
    super();
  }

  facts(): Promise<RunFacts> {
    return json(`${this.path}/facts.json`);
  }

  sightings(): Promise<SightingFacts[]> {
    return Promise.resolve([]);
  }

  postures(): Promise<null> {
    return Promise.resolve(null);
  }

  walls(number: number): Promise<WallsFacts> {
    if (this.past && number >= PAST_WALLS) return this.past.readWalls(number - PAST_WALLS);
    return json(`${this.path}/walls/${number}.json`);
  }

  table(): Promise<never> {
    return Promise.reject(new Error(NOTHING));
  }
}

/** What robots have in view now, and of a branch what they observed before it began. */
class LiveObservations implements ObservationSource {
  step = -1;
  seen: [string, string][] = [];

  constructor(
    private readonly run: Run,
    private readonly past: Run | null,
    private readonly since: number,
  ) {}

  at(step: number): Observation[] | null {
    if (step < this.since) return this.past?.observations?.at(step) ?? [];
    if (step !== this.step) return [];
    return this.seen.map(([robot, user]) => {
      const pose = this.run.tracks.get(user)?.poseAt(step * this.run.clock.stepUs);
      const x = pose ? this.run.home.metres(pose.x, 0) : NaN;
      const y = pose ? this.run.home.metres(pose.y, 1) : NaN;
      return { robot, user, x, y, room: "", trueUser: null, trueX: x, trueY: y };
    });
  }

  async load(step: number): Promise<void> {
    if (step < this.since) await this.past?.observations?.load(step);
  }
}

export class Feed {
  readonly status = signal<LiveFrame | null>(null);
  private readonly observations: LiveObservations;
  private readonly decisions: Decisions;
  private stream: EventSource | null = null;
  private lastStep: number;

  private constructor(
    readonly run: Run,
    past: Run | null,
    readonly since: number,
  ) {
    this.lastStep = since - 1;
    this.observations = new LiveObservations(run, past, since);
    run.observations = this.observations;
    const us = since * run.clock.stepUs;
    run.knownUs = us;
    run.decisions = this.decisions = past?.decisions?.until(us) ?? new Decisions();
    for (const { name } of run.bodies) {
      run.tracks.set(name, past?.tracks.get(name)?.until(us) ?? Track.none());
      run.rooms.set(name, stretchesUntil(past?.roomsOf(name) ?? { from: [], to: [], value: [] }, us));
    }
    if (past) this.takePast(past, us);
    run.isRead.value = true;
  }

  /** Follow a simulation; a branch begins with what the run before it was. */
  static async open(session: LiveSession, past: Run | null): Promise<Feed> {
    const source = new LiveSource(session.path, past);
    const feed = new Feed(new Run(await source.facts(), source), past, session.since);
    feed.run.facts.title = session.title;
    return feed;
  }

  private takePast(past: Run, us: number): void {
    const { run, since } = this;
    for (const row of past.events.rows.slice(0, past.events.before(us))) run.events.add(row.step, row.us, row.entity, row.event, row.user, row.detail);
    run.facts.marks = past.facts.marks.filter((mark) => mark.kind === "intervention" && mark.step < since);
    const walls = past.facts.walls.filter((change) => change.step < since);
    run.facts.walls = [...walls.map(({ step, walls }) => ({ step, walls: walls + PAST_WALLS })), { step: since, walls: 0 }];
    run.sightings = past.sightings.map((lane) => {
      const count = lane.first.filter((first) => first < since).length;
      const last = lane.last.slice(0, count).map((step) => Math.min(step, since - 1));
      return { ...lane, first: lane.first.slice(0, count), last, false: lane.false.slice(0, count) };
    });
    run.beliefs = past.beliefs.map((beliefs) => beliefs.until(us));
  }

  follow(): void {
    this.stream = new EventSource(`${this.run.path}/frames`);
    this.stream.onmessage = (event) => this.take(JSON.parse(event.data as string) as LiveFrame[]);
    this.stream.onopen = () => {
      connected.value = true;
    };
    this.stream.onerror = () => {
      connected.value = false;
    };
  }

  /** Take in frames, in order. */
  take(frames: readonly LiveFrame[]): void {
    const last = frames[frames.length - 1];
    if (!last) return;
    for (const frame of frames) this.add(frame);
    batch(() => {
      this.status.value = last;
      this.run.changed();
      if (state.follow.value) state.goTo(this.present());
    });
    if (last.served_as >= 0) void this.end(last.served_as);
  }

  /** The moment up to which all simulations that are shown have come. */
  private present(): number {
    const steps = feeds.value.map((feed) => feed.status.value?.step ?? Infinity);
    return Math.min(this.lastStep, ...steps) * this.run.clock.stepUs;
  }

  close(): void {
    this.stream?.close();
    feeds.value = feeds.value.filter((feed) => feed !== this);
    state.live.value = feeds.value.length > 0;
  }

  /** The simulation is over: from now on its run is shown as a stored one. */
  private async end(number: number): Promise<void> {
    this.stream?.close();
    await this.run.attempt(async () => {
      const run = await Run.open(new ServedRun(`run/${number}`));
      await run.readPoses();
      await run.readRest();
      batch(() => {
        state.runs.value = state.runs.value.map((entry) => (entry === this.run ? run : entry));
        this.close();
        // Read by tests and by nobody else: what was live is a stored run from now on.
        document.documentElement.dataset.ended = String(Number(document.documentElement.dataset.ended ?? 0) + 1);
      });
    });
  }

  private add(frame: LiveFrame): void {
    const us = frame.step * this.run.clock.stepUs;
    for (const event of frame.events) {
      const at = event.step * this.run.clock.stepUs;
      this.run.events.add(event.step, at, event.entity, event.event, event.user, event.detail);
    }
    this.run.facts.marks.push(...frame.marks);
    this.run.facts.slows.push(...frame.slows);
    const { walls } = this.run.facts;
    if (walls[walls.length - 1]!.walls !== frame.walls) walls.push({ step: frame.step, walls: frame.walls });
    for (const body of frame.bodies) {
      const track = this.run.tracks.get(body.name);
      if (!track) continue;
      track.append(us, body);
      this.run.ahead.set(body.name, [body.x, body.y, ...body.ahead.flatMap(([, x, y]) => [x, y])]);
      const nextUs = body.decides < 0 ? NaN : body.decides * this.run.clock.stepUs;
      this.decisions.add(body.name, { us, behavior: body.behavior, reason: body.reason, nextUs });
      this.addRoom(body.name, us, body.away ? AWAY : this.run.home.roomAt(body.x, body.y));
    }
    this.observations.step = frame.step;
    this.observations.seen = frame.seen;
    for (const [robot, user] of frame.seen) this.addSighting(robot, user, frame.step);
    for (const [name, ofUsers] of Object.entries(frame.beliefs)) this.addBeliefs(name, us, ofUsers);
    this.lastStep = frame.step;
    this.run.knownUs = us;
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

  private addBeliefs(name: string, us: number, ofUsers: Record<string, number[]>): void {
    let beliefs = this.run.beliefs.find((entry) => entry.name === name);
    if (!beliefs) this.run.beliefs.push((beliefs = new Beliefs(name, new Map(), this.run.isOfNow(name))));
    for (const [user, shares] of Object.entries(ofUsers)) beliefs.add(user, us, Float64Array.from(shares));
  }
}

/** The simulation of a run; undefined for a stored one. */
export function feedOf(run: Run): Feed | undefined {
  return feeds.value.find((feed) => feed.run === run);
}

/** Show simulations from now on. */
export function show(shown: readonly Feed[]): void {
  feeds.value = shown;
  state.live.value = shown.length > 0;
}
