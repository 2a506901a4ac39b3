"""What a policy is, and the learned ones: their network, their files, and how they leave a training library."""
