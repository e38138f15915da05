"""Viewing: pictures, films, pages, reports and notebooks of homes and runs."""
