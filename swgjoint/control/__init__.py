"""Model-based control: feed-forward, compensation, optimal control."""
