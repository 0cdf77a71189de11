"""Studies: tasks × settings × seeds on one machine or many, each job a run directory."""

from motorgrad.studies._driver import PLACES, On, drive, run_study
from motorgrad.studies._jobs import AnyJob, JobFolder, Outcome, Work
from motorgrad.studies._page import settings_text
from motorgrad.studies._partition import Job
from motorgrad.studies._results import Best, Results
from motorgrad.studies._scores import ScoreEach
from motorgrad.studies._search import Search, SearchResults
from motorgrad.studies._study import Design, Study

__all__ = [
    "PLACES",
    "AnyJob",
    "Best",
    "Design",
    "Job",
    "JobFolder",
    "On",
    "Outcome",
    "Results",
    "ScoreEach",
    "Search",
    "SearchResults",
    "Study",
    "Work",
    "drive",
    "run_study",
    "settings_text",
]
