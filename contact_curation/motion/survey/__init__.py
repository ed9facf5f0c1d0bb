"""What a stream of poses shows by itself, before any rule of cutting: free falls, rests, and what they say of the tracker."""
