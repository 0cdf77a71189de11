"""Comparisons of methods: settings chosen on some seeds and judged on others, with a page and tables."""
