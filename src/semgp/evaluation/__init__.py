"""Metrics, experiments, tables and figures."""
