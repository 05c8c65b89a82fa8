"""What a model lacks: effects, evidence, verdict, gain."""
