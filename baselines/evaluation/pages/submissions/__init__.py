"""Submissions to the leaderboard: folders of others that are checked, scored, and added to the page."""
