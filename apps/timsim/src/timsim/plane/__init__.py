"""Pictures and films of what a particle learns in its plane."""

from timsim.plane._learning_film import Course, film_learning
from timsim.plane._of_runs import animate, course_of
from timsim.plane._picture import Animation, PlanePicture

__all__ = ["Animation", "Course", "PlanePicture", "animate", "course_of", "film_learning"]
