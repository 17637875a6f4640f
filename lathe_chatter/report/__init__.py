"""Pictures of runs, charts and maps: readable at a glance, the same colours throughout."""

from __future__ import annotations

from lathe_chatter.report.run_report import draw_run

__all__ = ['draw_run']
