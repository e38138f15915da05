/** Steps and local times of a run. Times are microseconds since its start. */

const DAY_MS = 86_400_000;
export const DAY_US = 86_400e6;
const WEEKDAYS = ["Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"];
const MONTHS = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];

const two = (value: number): string => String(value).padStart(2, "0");

export class Clock {
  /** Local time of the start, in milliseconds as if local time were UTC. */
  readonly startMs: number;

  constructor(
    start: string,
    readonly stepUs: number,
    public steps: number,
  ) {
    this.startMs = Date.parse(start.endsWith("Z") ? start : `${start}Z`);
  }

  get endUs(): number {
    return this.steps * this.stepUs;
  }

  /** The step that a moment belongs to; the last one at the end of the run. */
  stepAt(us: number): number {
    return Math.max(0, Math.min(this.steps - 1, Math.floor(us / this.stepUs)));
  }

  date(us: number): Date {
    return new Date(this.startMs + us / 1000);
  }

  /** The day of the run that a moment is in: 1 is the date it starts on. */
  day(us: number): number {
    const first = Math.floor(this.startMs / DAY_MS);
    return Math.floor((this.startMs + us / 1000) / DAY_MS) - first + 1;
  }

  /** Midnight that begins a day of the run; the first may lie before the start. */
  dayStart(day: number): number {
    const first = Math.floor(this.startMs / DAY_MS);
    return ((first + day - 1) * DAY_MS - this.startMs) * 1000;
  }

  /** The hours since midnight. */
  hourAt(us: number): number {
    return (us - this.dayStart(this.day(us))) / 3600e6;
  }

  timeText(us: number, seconds = true): string {
    const date = this.date(us);
    const text = `${two(date.getUTCHours())}:${two(date.getUTCMinutes())}`;
    return seconds ? `${text}:${two(date.getUTCSeconds())}` : text;
  }

  dateText(us: number): string {
    const date = this.date(us);
    const day = WEEKDAYS[date.getUTCDay()];
    return `${day} ${date.getUTCDate()} ${MONTHS[date.getUTCMonth()]}`;
  }

  text(us: number): string {
    return `${this.dateText(us)} ${this.timeText(us)}`;
  }

  /** Local time as ISO 8601, without a time zone. */
  iso(us: number): string {
    return this.date(us).toISOString().slice(0, 19);
  }

  /**
   * The moment that a text names: "2026-01-07T18:30", "Wed 7 Jan 18:30", "day 3 18:30", "18:30" on the
   * day of `nearUs`, "2 d 14 h" since the start, or "step 5000". Null where it names none.
   */
  parse(text: string, nearUs = 0): number | null {
    const words = text.trim().toLowerCase();
    const step = /^step (\d+)$/.exec(words);
    if (step) return this.inside(Number(step[1]) * this.stepUs);
    const iso = /^(\d{4}-\d{2}-\d{2})(?:[t ](\d{1,2}:\d{2}(?::\d{2})?))?$/.exec(words);
    if (iso) {
      const ms = Date.parse(`${iso[1]}T${(iso[2] ?? "00:00").padStart(5, "0")}Z`);
      return Number.isNaN(ms) ? null : this.inside((ms - this.startMs) * 1000);
    }
    const since = /^(?:(\d+) ?d)? ?(?:(\d+) ?h)? ?(?:(\d+) ?min)? ?(?:(\d+) ?s)?$/.exec(words);
    if (since && words) {
      const [days, hours, minutes, seconds] = since.slice(1).map((part) => Number(part ?? 0));
      return this.inside((((days! * 24 + hours!) * 60 + minutes!) * 60 + seconds!) * 1e6);
    }
    const date = /^(?:[a-z]{3},? )?(\d{1,2})\.? ([a-z]{3})[a-z]*(?: (\d{4}))?(?:,? (\d{1,2}:\d{2}(?::\d{2})?))?$/.exec(words);
    if (date) return this.ofDate(Number(date[1]), date[2]!, date[3], date[4] ?? "00:00");
    const day = /^(?:day (\d+))?\s*(?:(\d{1,2}):(\d{2})(?::(\d{2}))?)?$/.exec(words);
    if (!day || !words) return null;
    const number = day[1] ? Number(day[1]) : this.day(nearUs);
    const [hours, minutes, seconds] = [day[2], day[3], day[4]].map((part) => Number(part ?? 0));
    if (hours! > 23 || minutes! > 59 || seconds! > 59) return null;
    const us = ((hours! * 60 + minutes!) * 60 + seconds!) * 1e6;
    return this.inside(this.dayStart(number) + us);
  }

  /** The moment of a day and month: in a year, or in the first year in which the run has it. */
  private ofDate(day: number, name: string, year: string | undefined, time: string): number | null {
    const month = MONTHS.findIndex((each) => each.toLowerCase() === name) + 1;
    const years = year ? [Number(year)] : [this.date(0).getUTCFullYear(), this.date(this.endUs).getUTCFullYear()];
    for (const each of month ? years : []) {
      const found = this.parse(`${each}-${two(month)}-${two(day)}T${time}`);
      if (found !== null) return found;
    }
    return null;
  }

  private inside(us: number): number | null {
    return us >= 0 && us <= this.endUs ? us : null;
  }
}

/** A duration in few words: "3 h 20 min". */
export function durationText(us: number): string {
  const seconds = Math.round(us / 1e6);
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
  if (seconds < 86_400) {
    return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
  }
  return `${Math.floor(seconds / 86_400)} d ${Math.floor((seconds % 86_400) / 3600)} h`;
}
