"""Tests of RoboScribe."""
