"""Logs of made-up homes in the layout of CASAS, with an activity on each line."""

from collections.abc import Collection, Mapping
from datetime import date, timedelta
from pathlib import Path

DAY = (
    ("00:30", "Bedroom", "Sleep"), ("03:00", "Bedroom", "Sleep"), ("05:30", "Bedroom", "Sleep"),
    ("07:00", "Bathroom", "Toilet"), ("07:20", "Kitchen", "Eat_Breakfast"),
    ("08:10", "LivingRoom", "Read"), ("10:00", "OutsideDoor", "Leave_Home"),
    ("12:00", "OutsideDoor", "Enter_Home"), ("12:10", "Kitchen", "Cook_Lunch"),
    ("13:10", "LivingRoom", "Watch_TV"), ("15:00", "Bathroom", "Toilet"),
    ("15:20", "LivingRoom", "Relax"), ("18:00", "Kitchen", "Cook_Dinner"),
    ("19:30", "LivingRoom", "Watch_TV"), ("22:00", "Bedroom", "Sleep"), ("23:50", "Bedroom", "Sleep"),
)  # fmt: skip


def write_home(
    path: Path,
    days,
    *,
    shift_min=0,
    silent: Collection[int] = (),
    labels: Mapping[str, str] | None = None,
) -> Path:
    """Write days that begin later from day to day by up to some minutes; some days are silent."""
    lines = []
    for number in (number for number in range(days) if number not in silent):
        day = date(2024, 3, 4) + timedelta(days=number)
        for clock, room, what in DAY:
            late = (number * 7 + shift_min) % 20 if "00:30" < clock < "23:00" else 0
            minutes = int(clock[:2]) * 60 + int(clock[3:]) + late
            label = (labels or {}).get(room, room)
            if label:
                at = f"{minutes // 60:02}:{minutes % 60:02}"
                lines.append(f"{day} {at}:00.000000 {label} {label} ON {what}")
    path.write_text("\n".join(lines) + "\n")
    return path
