"""What can be driven or watched: a replay, a policy's rollout, a takeover, the practice drive."""
