"""The world, the car, the camera, rollouts, ground truth, teachers, records and their store."""
