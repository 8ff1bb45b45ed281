"""Learned agents as policies: what they see, their networks, their files. No learning library is needed to run one."""
